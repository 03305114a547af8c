// Several blocks chosen at once: by a frame drawn on the canvas, by clicks with Ctrl or Shift, or all of them. A chosen
// block means itself with all that is inside it; what hangs below it is chosen only when it has its own outline.
import * as Blockly from 'blockly/core';
import {removeRuns} from './carry';
import {pathOf} from './renderer';

type Block = Blockly.BlockSvg;

/** How far the mouse may move and the press still be a click, in pixels. */
const STILL = 5;
/** The top of a block that holds others: a frame that touches it means the block, one further down what is inside. */
const HEAD = 48;

const selections = new WeakMap<Blockly.Workspace, Selection>();

export class Selection {
  private chosen = new Set<Block>();
  /** What the mouse is in the middle of: a press on a block that waits to be a click. */
  private pressed: {x: number; y: number; block: Block; toggles: boolean; before: Block | null} | null = null;

  constructor(readonly workspace: Blockly.WorkspaceSvg) {
    selections.set(workspace, this);
    const place = workspace.getInjectionDiv();
    place.addEventListener('pointerdown', (event) => this.onDown(event), true);
    place.addEventListener('pointerup', (event) => this.onUp(event), true);
    place.addEventListener('keydown', (event) => {
      if (event.key === 'Escape' && !workspace.isDragging() && !Blockly.getFocusManager().ephemeralFocusTaken()) this.letGo();
    });
    workspace.addChangeListener((event) => {
      if (event instanceof Blockly.Events.Click && event.targetType === 'workspace') this.letGo();
    });
  }

  /** More than one block, or none; in the order in which they are read. */
  get blocks(): Block[] {
    if ([...this.chosen].some((each) => each.isDeadOrDying())) this.show([...this.chosen].filter((each) => !each.isDeadOrDying()));
    return this.chosen.size > 1 ? [...this.chosen] : [];
  }

  /** Chooses exactly these: one is selected as by a click, of several one has the keys. */
  choose(blocks: Iterable<Block>): void {
    const outermost = withoutInner(new Set(blocks));
    this.show(outermost.length > 1 ? outermost : []);
    const [first] = outermost;
    const focused = Blockly.getFocusManager().getFocusedNode();
    if (outermost.includes(focused as Block)) return;
    if (first) Blockly.getFocusManager().focusNode(first);
    else if (focused instanceof Blockly.BlockSvg) Blockly.getFocusManager().focusNode(this.workspace);
  }

  /** Shows which are chosen, without moving the keys: while a frame is drawn. */
  show(blocks: Iterable<Block>): void {
    const now = new Set(blocks);
    for (const each of this.chosen) if (!now.has(each) && !each.isDeadOrDying()) pathOf(each)?.setChosen(false);
    for (const each of now) if (!this.chosen.has(each)) pathOf(each)?.setChosen(true);
    this.chosen = now;
  }

  letGo(): void {
    if (this.chosen.size) this.show([]);
  }

  /** The chosen block that this one is, or is inside of. */
  around(block: Block | null): Block | null {
    for (let each = block; each; each = each.getSurroundParent()) if (this.chosen.has(each)) return each;
    return null;
  }

  /** The keys went to a block, by a click or by arrow keys: the others are let go when it is none of them. */
  focused(block: Block): void {
    if (this.chosen.size && !this.pressed?.toggles && !this.around(block)) this.letGo();
  }

  private onDown(event: PointerEvent): void {
    this.pressed = null;
    if (event.button !== 0 || !(event.target instanceof Element)) return;
    const id = event.target.closest('.blocklyDraggable')?.getAttribute('data-id');
    const under = id ? this.workspace.getBlockById(id) : null;
    if (!under || event.target.closest('.blocklyFlyout')) return;
    const block = this.around(under) ?? withoutShadow(under);
    const before = Blockly.common.getSelected();
    this.pressed = {x: event.clientX, y: event.clientY, block,
      toggles: event.shiftKey || event.ctrlKey || event.metaKey,
      before: before instanceof Blockly.BlockSvg && before.workspace === this.workspace ? before : null};
  }

  private onUp(event: PointerEvent): void {
    const {pressed} = this;
    if (!pressed) return;
    const still = Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) < STILL;
    if (still && !this.workspace.isDragging()) {
      if (pressed.toggles) {
        this.workspace.getGesture(event)?.cancel();  // a click would open the field below the mouse
        this.toggle(pressed.block, pressed.before);
      } else if (event.button === 0) this.letGo();
    }
    this.pressed = null;
  }

  private toggle(block: Block, before: Block | null): void {
    const now = new Set(this.chosen);
    if (!now.size && before && before !== block) now.add(before);
    if (!now.delete(block)) now.add(block);
    this.choose(now);
    if (now.has(block)) Blockly.getFocusManager().focusNode(block);
  }
}

function withoutShadow(block: Block): Block {
  let real = block;
  while (real.isShadow() && real.getParent()) real = real.getParent()!;
  return real;
}

/** In the order of reading; what is inside another chosen one goes with it anyway. */
function withoutInner(blocks: ReadonlySet<Block>): Block[] {
  if (blocks.size < 2) return [...blocks];
  const found: Block[] = [];
  const [first] = blocks;
  const walk = (block: Block | null) => {
    for (let each = block; each; each = each.getNextBlock()) {
      if (blocks.has(each)) found.push(each);
      else for (const child of each.getChildren(true)) if (child !== each.getNextBlock()) walk(child);
    }
  };
  for (const top of first?.workspace.getTopBlocks(true) ?? []) walk(top);
  return found;
}

/** All that are chosen together with this block; none when it is not one of several. */
export function chosenWith(block: Block | null | undefined): Block[] {
  const selection = block ? selections.get(block.workspace) : undefined;
  return selection?.around(block ?? null) ? selection.blocks : [];
}

export function selectionOf(workspace: Blockly.Workspace): Selection | undefined {
  return selections.get(workspace);
}

/** Chosen blocks that hang below each other, together; the topmost first. */
export function runsOf(blocks: readonly Block[]): Block[][] {
  const chosen = new Set(blocks);
  return blocks.filter((each) => !chosen.has(each.getPreviousBlock() as Block) || each.getPreviousBlock()?.getNextBlock() !== each)
    .map((head) => {
      const run: Block[] = [];
      for (let each: Block | null = head; each && chosen.has(each); each = each.getNextBlock()) run.push(each);
      return run;
    });
}

/** How many blocks a person sees in them: grey values in gaps are none. */
export function countIn(blocks: readonly Block[]): number {
  let count = 0;
  for (const block of blocks) {
    const below = new Set(block.getNextBlock()?.getDescendants(false) ?? []);
    count += block.getDescendants(false).filter((each) => !each.isShadow() && !below.has(each)).length;
  }
  return count;
}

interface Area {
  block: Block;
  left: number;
  top: number;
  right: number;
  bottom: number;
}

/** Where each block can be hit by a frame, in units of the canvas: worked out once, as none moves meanwhile. */
export function areasOf(workspace: Blockly.WorkspaceSvg): Area[] {
  const areas: Area[] = [];
  const add = (block: Block) => {
    const {x, y} = block.previousConnection ?? block.outputConnection ?? block.getRelativeToSurfaceXY();
    const holds = !block.isCollapsed() && block.inputList.some((input) => input.type === Blockly.inputs.inputTypes.STATEMENT);
    const bottom = y + (holds ? Math.min(block.height, HEAD) : block.height);
    areas.push({block, left: x, top: y, right: x + block.childlessWidth, bottom});
    if (!holds) return;
    for (const input of block.inputList) {
      if (input.type === Blockly.inputs.inputTypes.STATEMENT) walk(input.connection?.targetBlock() as Block | null);
    }
  };
  const walk = (first: Block | null) => {
    for (let each = first; each; each = each.getNextBlock()) if (!each.isShadow()) add(each);
  };
  for (const top of workspace.getTopBlocks(true)) walk(top);
  return areas;
}

const focus = Blockly.BlockSvg.prototype.onNodeFocus;
Blockly.BlockSvg.prototype.onNodeFocus = function (this: Block) {
  focus.call(this);
  selections.get(this.workspace)?.focused(this);
};

/** Deleting one of several deletes them all, as one step. */
const remove = Blockly.BlockSvg.prototype.checkAndDelete;
Blockly.BlockSvg.prototype.checkAndDelete = function (this: Block) {
  const chosen = chosenWith(this).filter((each) => each.isDeletable());
  if (!chosen.length) {
    remove.call(this);
    return;
  }
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  this.workspace.hideChaff();
  removeRuns(runsOf(chosen));
  Blockly.Events.setGroup(group);
};
