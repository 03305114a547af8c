// Several blocks and notes chosen at once: by a frame drawn on the canvas, by clicks with Ctrl or Shift, or all of them.
// A chosen block means itself with all that is inside it; what hangs below it is chosen only when it has its own
// outline. The notes are those of the canvas: one beside a block belongs to it.
import * as Blockly from 'blockly/core';
import {removeAll} from './carry';
import {pathOf} from './renderer';

type Block = Blockly.BlockSvg;
export type Note = Blockly.comments.RenderedWorkspaceComment;
/** What can be chosen. */
export type Item = Block | Note;

export function isNote(item: unknown): item is Note {
  return item instanceof Blockly.comments.RenderedWorkspaceComment;
}

/** How far the mouse may move and the press still be a click, in pixels. */
const STILL = 5;
/** The top of a block that holds others: a frame that touches it means the block, one further down what is inside. */
const HEAD = 48;

const selections = new WeakMap<Blockly.Workspace, Selection>();

export class Selection {
  private chosen = new Set<Item>();
  /** What the mouse is in the middle of: a press on a block that waits to be a click. */
  private pressed: {x: number; y: number; item: Item; toggles: boolean; before: Item | null} | null = null;

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

  /** More than one, or none; the blocks in the order in which they are read, then the notes. */
  get items(): Item[] {
    if ([...this.chosen].some((each) => each.isDeadOrDying())) this.show([...this.chosen].filter((each) => !each.isDeadOrDying()));
    return this.chosen.size > 1 ? [...this.chosen] : [];
  }

  /** Chooses exactly these: one is selected as by a click, of several one has the keys. */
  choose(items: Iterable<Item>): void {
    const all = [...new Set(items)];
    const outermost = [...withoutInner(new Set(blocksIn(all))), ...all.filter(isNote)];
    this.show(outermost.length > 1 ? outermost : []);
    const [first] = outermost;
    const focused = Blockly.getFocusManager().getFocusedNode();
    if (outermost.includes(focused as Item)) return;
    if (first) Blockly.getFocusManager().focusNode(first);
    else if (focused instanceof Blockly.BlockSvg || isNote(focused)) Blockly.getFocusManager().focusNode(this.workspace);
  }

  /** Shows which are chosen, without moving the keys: while a frame is drawn. */
  show(items: Iterable<Item>): void {
    const now = new Set(items);
    for (const each of this.chosen) if (!now.has(each) && !each.isDeadOrDying()) outline(each, false);
    for (const each of now) if (!this.chosen.has(each)) outline(each, true);
    this.chosen = now;
  }

  letGo(): void {
    if (this.chosen.size) this.show([]);
  }

  /** The chosen note that this is, or the block that it is or is inside of. */
  around(item: Item | null): Item | null {
    if (isNote(item)) return this.chosen.has(item) ? item : null;
    for (let each = item; each; each = each.getSurroundParent()) if (this.chosen.has(each)) return each;
    return null;
  }

  /** The keys went to it, by a click or by arrow keys: the others are let go when it is none of them. */
  focused(item: Item): void {
    if (this.chosen.size && !this.pressed?.toggles && !this.around(item)) this.letGo();
  }

  private onDown(event: PointerEvent): void {
    this.pressed = null;
    if (event.button !== 0 || !(event.target instanceof Element)) return;
    const id = event.target.closest('.blocklyDraggable')?.getAttribute('data-id');
    const under = id ? this.workspace.getBlockById(id) ?? this.workspace.getCommentById(id) : null;
    if (!isItem(under) || event.target.closest('.blocklyFlyout, textarea')) return;
    const item = this.around(under) ?? (isNote(under) ? under : withoutShadow(under));
    const before = Blockly.common.getSelected();
    this.pressed = {x: event.clientX, y: event.clientY, item,
      toggles: event.shiftKey || event.ctrlKey || event.metaKey,
      before: isItem(before) && before.workspace === this.workspace ? before : null};
  }

  private onUp(event: PointerEvent): void {
    const {pressed} = this;
    if (!pressed) return;
    const still = Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) < STILL;
    if (still && !this.workspace.isDragging()) {
      if (pressed.toggles) {
        this.workspace.getGesture(event)?.cancel();  // a click would open the field below the mouse
        this.toggle(pressed.item, pressed.before);
      } else if (event.button === 0) this.letGo();
    }
    this.pressed = null;
  }

  private toggle(item: Item, before: Item | null): void {
    const now = new Set(this.chosen);
    if (!now.size && before && before !== item) now.add(before);
    if (!now.delete(item)) now.add(item);
    this.choose(now);
    if (now.has(item)) Blockly.getFocusManager().focusNode(item);
  }
}

function isItem(item: unknown): item is Item {
  return item instanceof Blockly.BlockSvg || isNote(item);
}

function outline(item: Item, chosen: boolean): void {
  if (isNote(item)) item.getSvgRoot().classList.toggle('nepChosen', chosen);
  else pathOf(item)?.setChosen(chosen);
}

function blocksIn(items: readonly Item[]): Block[] {
  return items.filter((each): each is Block => !isNote(each));
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

/** All blocks and notes that are chosen together with this one; none when it is not one of several. */
export function allChosenWith(item: Item | null | undefined): Item[] {
  const selection = item ? selections.get(item.workspace) : undefined;
  return selection?.around(item ?? null) ? selection.items : [];
}

/** The blocks among them. */
export function chosenWith(item: Item | null | undefined): Block[] {
  return blocksIn(allChosenWith(item));
}

/** The notes among them. */
export function notesChosenWith(item: Item | null | undefined): Note[] {
  return allChosenWith(item).filter(isNote);
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
  item: Item;
  left: number;
  top: number;
  right: number;
  bottom: number;
}

/** Where each block and note can be hit by a frame, in units of the canvas: worked out once, as none moves meanwhile. */
export function areasOf(workspace: Blockly.WorkspaceSvg): Area[] {
  const areas: Area[] = [];
  const add = (block: Block) => {
    const {x, y} = block.previousConnection ?? block.outputConnection ?? block.getRelativeToSurfaceXY();
    const holds = !block.isCollapsed() && block.inputList.some((input) => input.type === Blockly.inputs.inputTypes.STATEMENT);
    const bottom = y + (holds ? Math.min(block.height, HEAD) : block.height);
    areas.push({item: block, left: x, top: y, right: x + block.childlessWidth, bottom});
    if (!holds) return;
    for (const input of block.inputList) {
      if (input.type === Blockly.inputs.inputTypes.STATEMENT) walk(input.connection?.targetBlock() as Block | null);
    }
  };
  const walk = (first: Block | null) => {
    for (let each = first; each; each = each.getNextBlock()) if (!each.isShadow()) add(each);
  };
  for (const top of workspace.getTopBlocks(true)) walk(top);
  for (const item of workspace.getTopComments().filter(isNote)) {
    const {left, top, right, bottom} = item.getBoundingRectangle();
    areas.push({item, left, top, right, bottom});
  }
  return areas;
}

const focus = Blockly.BlockSvg.prototype.onNodeFocus;
Blockly.BlockSvg.prototype.onNodeFocus = function (this: Block) {
  focus.call(this);
  selections.get(this.workspace)?.focused(this);
};

const focusNote = Blockly.comments.RenderedWorkspaceComment.prototype.onNodeFocus;
Blockly.comments.RenderedWorkspaceComment.prototype.onNodeFocus = function (this: Note) {
  focusNote.call(this);
  selections.get(this.workspace)?.focused(this);
};

/** Deleting one of several deletes them all, as one step; whether it was one of several. */
export function removeChosenWith(item: Item): boolean {
  const chosen = allChosenWith(item).filter((each) => each.isDeletable());
  if (!chosen.length) return false;
  const {workspace} = item;
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  workspace.hideChaff();
  removeAll(runsOf(blocksIn(chosen)), chosen.filter(isNote));
  Blockly.Events.setGroup(group);
  return true;
}

const remove = Blockly.BlockSvg.prototype.checkAndDelete;
Blockly.BlockSvg.prototype.checkAndDelete = function (this: Block) {
  if (!removeChosenWith(this)) remove.call(this);
};

/** Blockly's key deletes only the note that has the keys. */
export function deleteByKey(): boolean {
  const focused = Blockly.getFocusManager().getFocusedNode();
  return isNote(focused) && removeChosenWith(focused);
}
