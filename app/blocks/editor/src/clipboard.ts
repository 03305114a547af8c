// Copying, cutting, pasting and duplicating blocks and notes. What is copied is text on the computer's clipboard, so
// that it can be pasted in another tab, in another Studio, or sent to somebody. What is pasted lies free and in sight.
import * as Blockly from 'blockly/core';
import {withoutTypeChecks} from './checker';
import {freePlace, inSight, obstacles} from './free_place';
import {focusedBlock} from './help';
import {type Item, type Note, allChosenWith, chosenWith, notesChosenWith, removeChosenWith, runsOf, selectionOf} from './selection';
import {type BlockState, unwrapUnknown, wrapUnknown} from './unknown_blocks';

/** Every text of ours begins so; `app/ui/blockly/bridge.py` looks for it. */
const MARK = '{"nepStudio":';

export interface Copied {
  nepStudio: 'block' | 'note';
  state: BlockState;
}

/** Several scripts, and notes, whose places beside each other stay. */
export interface CopiedBlocks {
  nepStudio: 'blocks';
  states: BlockState[];
  notes?: BlockState[];
}

type Point = Blockly.utils.Coordinate;

/** The computer's clipboard: the page itself may not read it. */
export interface SystemClipboard {
  write(text: string): void;
  read(): Promise<string>;
}

const FROM_ORIGINAL = 34;

export class Clipboard {
  /** What was copied here: pasted when the computer's clipboard holds other things by now. */
  private copied = '';
  private mouse: {x: number; y: number} | null = null;

  constructor(private readonly system: SystemClipboard) {
    document.addEventListener('pointermove', (event) => this.mouse = {x: event.clientX, y: event.clientY}, true);
    document.documentElement.addEventListener('pointerleave', () => this.mouse = null);
  }

  /** Whether there was something to copy. */
  copy(item = focusedItem()): boolean {
    const copied = item && copyOf(item);
    if (!copied) return false;
    this.copied = JSON.stringify(copied);
    this.system.write(this.copied);
    return true;
  }

  cut(item = focusedItem()): boolean {
    if (!item || item.workspace.isFlyout || !item.isDeletable() || !this.copy(item)) return false;
    if (item instanceof Blockly.BlockSvg) item.checkAndDelete();
    else if (!removeChosenWith(item)) inOneStep(() => item.dispose());
    return true;
  }

  /** Beside the original. */
  duplicate(item = focusedItem()): boolean {
    if (!item || item.workspace.isFlyout) return false;
    const copied = copyOf(item);
    if (copied) add(copied, item.workspace, beside(item));
    return copied !== null;
  }

  /** At a place of the page, else under the mouse, beside the block that has the keys, or in the middle. */
  async paste(where: {x: number; y: number} | null = null): Promise<void> {
    const read = parse(await this.system.read()) ?? parse(this.copied);
    if (!read) return;
    const workspace = Blockly.common.getMainWorkspace() as Blockly.WorkspaceSvg;
    add(read, workspace, where ? toCanvas(workspace, where) : this.wanted(workspace));
  }

  private wanted(workspace: Blockly.WorkspaceSvg): Point {
    const block = focusedBlock();
    const byKeys = Blockly.keyboardNavigationController.getIsActive();
    if (!byKeys && this.mouse && isCanvas(workspace, this.mouse)) return toCanvas(workspace, this.mouse);
    if (block && block.workspace === workspace) return beside(block);
    const {left, right, top, bottom} = inSight(workspace);
    return new Blockly.utils.Coordinate(left + (right - left) / 3, top + (bottom - top) / 3);
  }
}

/** The block or note that has the keys, also by a field or gap of it. */
export function focusedItem(): Item | null {
  const node = Blockly.getFocusManager().getFocusedNode();
  return node instanceof Blockly.comments.RenderedWorkspaceComment ? node : focusedBlock();
}

/** `stack`: with the blocks that hang below it. */
export function stateOf(item: Item, stack = false): Copied | null {
  const data = item.toCopyData(stack) as {blockState?: unknown; commentState?: unknown} | null;
  if (data?.blockState) return {nepStudio: 'block', state: unwrapUnknown(data.blockState as BlockState)};
  return data?.commentState ? {nepStudio: 'note', state: data.commentState as BlockState} : null;
}

/** The item, or all that are chosen with it. */
function copyOf(item: Item): Copied | CopiedBlocks | null {
  if (!allChosenWith(item).length) return stateOf(item);
  const copied = copyOfAll(runsOf(chosenWith(item)), notesChosenWith(item));
  const [only, ...more] = copied.states;
  return only && !more.length && !copied.notes ? {nepStudio: 'block', state: only} : copied;
}

export function copyOfAll(runs: readonly Blockly.BlockSvg[][], notes: readonly Note[]): CopiedBlocks {
  const states = runs.map(stateOfRun).filter((each) => each !== null);
  const words = notes.map((each) => stateOf(each)?.state).filter((each) => each !== undefined);
  return {nepStudio: 'blocks', states, ...(words.length && {notes: words})};
}

/** Blocks that hang below each other, without what hangs below them and is not chosen. */
export function stateOfRun(run: readonly Blockly.BlockSvg[]): BlockState | null {
  let state: BlockState | null = null;
  for (const block of [...run].reverse()) {
    const copied = stateOf(block);
    if (copied) state = state ? {...copied.state, next: {block: withoutPlace(state)}} : copied.state;
  }
  return state;
}

function withoutPlace({x: _x, y: _y, ...rest}: BlockState): BlockState {
  return rest as BlockState;
}

/** What is on the clipboard, if it is ours. It may come from anywhere: whatever is in it has still to be made. */
function parse(text: string): Copied | CopiedBlocks | null {
  if (!text.startsWith(MARK)) return null;
  try {
    const {nepStudio, state, states, notes} = JSON.parse(text) as Copied & {states?: unknown; notes?: unknown};
    if ((nepStudio as string) === 'blocks') {
      const good = (Array.isArray(states) ? states as unknown[] : []).filter(isBlock);
      const words = (Array.isArray(notes) ? notes as unknown[] : []).filter(isState);
      return good.length || words.length ? {nepStudio: 'blocks', states: good, ...(words.length && {notes: words})} : null;
    }
    const isOne = ['block', 'note'].includes(nepStudio) && typeof state === 'object' && state !== null;
    return isOne && (nepStudio === 'note' || typeof state.type === 'string') ? {nepStudio, state} : null;
  } catch {
    return null;
  }
}

function isState(state: unknown): state is BlockState {
  return typeof state === 'object' && state !== null;
}

function isBlock(state: unknown): state is BlockState {
  return isState(state) && typeof state.type === 'string';
}

function toCanvas(workspace: Blockly.WorkspaceSvg, {x, y}: {x: number; y: number}): Point {
  return Blockly.utils.svgMath.screenToWsCoordinates(workspace, new Blockly.utils.Coordinate(x, y));
}

/** Whether the mouse is over the canvas itself, not over the toolbox or what floats. */
function isCanvas(workspace: Blockly.WorkspaceSvg, {x, y}: {x: number; y: number}): boolean {
  const under = document.elementFromPoint(x, y);
  return under !== null && workspace.getParentSvg().contains(under) && !under.closest('.blocklyFlyout');
}

/** To the right of the stack that it is in, at its own height. */
function beside(item: Item): Point {
  const stack = item instanceof Blockly.BlockSvg ? item.getRootBlock() : item;
  const {right} = (stack as Blockly.IBoundedElement).getBoundingRectangle();
  return new Blockly.utils.Coordinate(right + FROM_ORIGINAL, item.getRelativeToSurfaceXY().y);
}

export function inOneStep<T>(change: () => T): T {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  try {
    return change();
  } finally {
    Blockly.Events.setGroup(group);
  }
}

/** Makes it as one step that undo takes back, lets it lie free, and gives it the keys; none: it can't be made. */
export function add(copied: Copied | CopiedBlocks, workspace: Blockly.WorkspaceSvg, wanted: Point): Item[] {
  const there = new Set<unknown>([...workspace.getTopBlocks(false), ...workspace.getTopComments()]);
  const {scrollX, scrollY} = workspace;
  workspace.hideChaff();
  const made = inOneStep(() => {
    try {
      return layFree(makeAll(copied, workspace, wanted), wanted);
    } catch (error) {
      console.warn(`not pasted: ${String(error)}`);
      for (const each of [...workspace.getTopBlocks(false), ...workspace.getTopComments()]) {
        if (!there.has(each)) each.dispose();
      }
      return [];
    }
  });
  workspace.scroll(scrollX, scrollY);  // more on the canvas is no reason to move what is there
  if (made[0]) Blockly.getFocusManager().focusNode(made[0]);
  if (made.length > 1) selectionOf(workspace)?.choose(made.flatMap(allOf));
  return made;
}

/** The note, or the blocks of the stack. */
function allOf(top: Item): Item[] {
  if (!(top instanceof Blockly.BlockSvg)) return [top];
  const blocks: Blockly.BlockSvg[] = [];
  for (let each: Blockly.BlockSvg | null = top; each; each = each.getNextBlock()) blocks.push(each);
  return blocks;
}

/** Together at a free place, as they were beside each other. */
function layFree(made: Item[], wanted: Point): Item[] {
  Blockly.renderManagement.triggerQueuedRenders();
  const boxes = made.map((each) => (each as Blockly.IBoundedElement).getBoundingRectangle());
  const [left, top] = [Math.min(...boxes.map((box) => box.left)), Math.min(...boxes.map((box) => box.top))];
  const size = {width: Math.max(...boxes.map((box) => box.right)) - left,
    height: Math.max(...boxes.map((box) => box.bottom)) - top};
  const [first] = made;
  if (!first) return made;
  const place = freePlace(wanted, size, obstacles(first.workspace, new Set(made)), inSight(first.workspace));
  for (const each of made) each.moveBy(place.x - left, place.y - top);
  return made;
}

function makeAll(copied: Copied | CopiedBlocks, workspace: Blockly.WorkspaceSvg, wanted: Point): Item[] {
  if (copied.nepStudio !== 'blocks') return [make(copied, workspace, wanted)];
  const each = (nepStudio: 'block' | 'note') => (state: BlockState) => {
    const place = new Blockly.utils.Coordinate(Number(state['x']) || 0, Number(state['y']) || 0);
    return make({nepStudio, state}, workspace, place);
  };
  return [...copied.states.map(each('block')), ...(copied.notes ?? []).map(each('note'))];
}

function make({nepStudio, state}: Copied, workspace: Blockly.WorkspaceSvg, {x, y}: Point): Item {
  const {id, ...rest} = {...state, x, y};
  void id;
  const how = {recordUndo: true};
  if (nepStudio === 'note') {
    return Blockly.serialization.workspaceComments.append(rest, workspace, how) as unknown as Item;
  }
  const placed = wrapUnknown(rest as BlockState) as Blockly.serialization.blocks.State;
  return withoutTypeChecks(() => Blockly.serialization.blocks.append(placed, workspace, how) as Blockly.BlockSvg);
}
