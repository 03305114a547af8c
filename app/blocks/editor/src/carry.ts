// Dragging selected blocks and notes as a group: they are detached from their scripts, which close.
import * as Blockly from 'blockly/core';

type Block = Blockly.BlockSvg;
type Note = Blockly.comments.RenderedWorkspaceComment;
type Item = Block | Note;
type Point = Blockly.utils.Coordinate;

const {Coordinate} = Blockly.utils;

/** Detaches consecutive blocks from their script; returns a function that puts them back. */
export function detachRun(run: readonly Block[]): () => void {
  const [head, tail] = [run[0]!, run[run.length - 1]!];
  const above = (head.previousConnection ?? head.outputConnection)?.targetConnection ?? null;
  const below = tail.getNextBlock();
  const position = head.getRelativeToSurfaceXY();
  if (below) tail.nextConnection!.disconnect();
  if (above) head.unplug(false);
  const next = below?.previousConnection ?? null;
  const heals = next !== null && above?.type === Blockly.ConnectionType.NEXT_STATEMENT &&
    above.getConnectionChecker().canConnect(above, next, false);
  if (heals) above.connect(next);
  return () => {
    if (heals) below!.unplug(false);
    if (above) above.connect((head.previousConnection ?? head.outputConnection)!);
    else head.moveTo(position);
    if (below) tail.nextConnection!.connect(next!);
  };
}

/** Deletes blocks and notes; the scripts that contained them close. */
export function removeAll(runs: readonly Block[][], notes: readonly Note[]): void {
  for (const run of runs) {
    detachRun(run);
    run[0]!.dispose(false);
  }
  for (const note of notes) note.dispose();
}

/** Group of dragged items: Blockly drags the head, the others follow at a constant distance. */
export class DraggedGroup {
  readonly head: Item;
  private readonly others: {item: Item; from: Point}[];
  private readonly putBack: (() => void)[];

  constructor(readonly runs: readonly Block[][], readonly notes: readonly Note[], draggedItem: Item) {
    const heads = runs.map((run) => run[0]!);
    this.head = notes.find((note) => note === draggedItem) ??
      heads[runs.findIndex((run) => run.includes(draggedItem as Block))] ?? heads[0]!;
    this.putBack = runs.map(detachRun);
    Blockly.renderManagement.triggerQueuedRenders();
    this.others = [...heads, ...notes].filter((item) => item !== this.head)
      .map((item) => ({item, from: item.getRelativeToSurfaceXY()}));
  }

  start(): void {
    for (const {item} of this.others) {
      if (item instanceof Blockly.BlockSvg) item.bringToFront();
      item.setDragging(true);
    }
  }

  move(by: Point): void {
    for (const {item, from} of this.others) item.moveDuringDrag(Coordinate.sum(from, by));
  }

  /** Ends the drag at the drop position; undo reverts the whole move. */
  end(by: Point): void {
    this.returnToStart();
    for (const {item} of this.others) item.moveBy(by.x, by.y, ['drag']);
  }

  /** Deletes the other items after the head was deleted. Undo restores them at their start positions. */
  remove(): void {
    this.returnToStart();
    for (const {item} of this.others) item.dispose(false);
  }

  /** Cancels the drag and reconnects all items as before. */
  revert(): void {
    this.returnToStart();
    for (const restore of [...this.putBack].reverse()) restore();
  }

  /** Moves the items back to their start positions without events. */
  private returnToStart(): void {
    Blockly.Events.disable();
    for (const {item, from} of this.others) {
      item.setDragging(false);
      item.moveTo(from);
    }
    Blockly.Events.enable();
  }
}
