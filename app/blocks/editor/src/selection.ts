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
const CLICK_TOLERANCE_PX = 5;
/** The top of a block that holds others: a frame that touches it means the block, one further down what is inside. */
const HEADER_HEIGHT = 48;

const selections = new WeakMap<Blockly.Workspace, Selection>();

export class Selection {
  private selectedItems = new Set<Item>();
  /** What the mouse is in the middle of: a press on a block that waits to be a click. */
  private pressed: {x: number; y: number; item: Item; toggles: boolean; before: Item | null} | null = null;

  constructor(readonly workspace: Blockly.WorkspaceSvg) {
    selections.set(workspace, this);
    const injectionDiv = workspace.getInjectionDiv();
    injectionDiv.addEventListener('pointerdown', (event) => this.onDown(event), true);
    injectionDiv.addEventListener('pointerup', (event) => this.onUp(event), true);
    injectionDiv.addEventListener('keydown', (event) => {
      if (event.key === 'Escape' && !workspace.isDragging() && !Blockly.getFocusManager().ephemeralFocusTaken()) this.clear();
    });
    workspace.addChangeListener((event) => {
      if (event instanceof Blockly.Events.Click && event.targetType === 'workspace') this.clear();
    });
  }

  /** More than one, or none; the blocks in the order in which they are read, then the notes. */
  get items(): Item[] {
    if ([...this.selectedItems].some((item) => item.isDeadOrDying())) this.setSelectedItems([...this.selectedItems].filter((item) => !item.isDeadOrDying()));
    return this.selectedItems.size > 1 ? [...this.selectedItems] : [];
  }

  /** Chooses exactly these: one is selected as by a click, of several one has the keys. */
  select(items: Iterable<Item>): void {
    const all = [...new Set(items)];
    const outermost = [...getOutermostBlocks(new Set(blocksIn(all))), ...all.filter(isNote)];
    this.setSelectedItems(outermost.length > 1 ? outermost : []);
    const [first] = outermost;
    const focused = Blockly.getFocusManager().getFocusedNode();
    if (outermost.includes(focused as Item)) return;
    if (first) Blockly.getFocusManager().focusNode(first);
    else if (focused instanceof Blockly.BlockSvg || isNote(focused)) Blockly.getFocusManager().focusNode(this.workspace);
  }

  /** Shows which are chosen, without moving the keys: while a frame is drawn. */
  setSelectedItems(items: Iterable<Item>): void {
    const now = new Set(items);
    for (const item of this.selectedItems) if (!now.has(item) && !item.isDeadOrDying()) setSelectedStyle(item, false);
    for (const item of now) if (!this.selectedItems.has(item)) setSelectedStyle(item, true);
    this.selectedItems = now;
  }

  clear(): void {
    if (this.selectedItems.size) this.setSelectedItems([]);
  }

  /** The chosen note that this is, or the block that it is or is inside of. */
  findSelectedAncestor(item: Item | null): Item | null {
    if (isNote(item)) return this.selectedItems.has(item) ? item : null;
    for (let block = item; block; block = block.getSurroundParent()) if (this.selectedItems.has(block)) return block;
    return null;
  }

  /** The keys went to it, by a click or by arrow keys: the others are let go when it is none of them. */
  onFocus(item: Item): void {
    if (this.selectedItems.size && !this.pressed?.toggles && !this.findSelectedAncestor(item)) this.clear();
  }

  private onDown(event: PointerEvent): void {
    this.pressed = null;
    if (event.button !== 0 || !(event.target instanceof Element)) return;
    const id = event.target.closest('.blocklyDraggable')?.getAttribute('data-id');
    const under = id ? this.workspace.getBlockById(id) ?? this.workspace.getCommentById(id) : null;
    if (!isItem(under) || event.target.closest('.blocklyFlyout, textarea')) return;
    const item = this.findSelectedAncestor(under) ?? (isNote(under) ? under : getNonShadowBlock(under));
    const before = Blockly.common.getSelected();
    this.pressed = {x: event.clientX, y: event.clientY, item,
      toggles: event.shiftKey || event.ctrlKey || event.metaKey,
      before: isItem(before) && before.workspace === this.workspace ? before : null};
  }

  private onUp(event: PointerEvent): void {
    const {pressed} = this;
    if (!pressed) return;
    const isClick = Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) < CLICK_TOLERANCE_PX;
    if (isClick && !this.workspace.isDragging()) {
      if (pressed.toggles) {
        this.workspace.getGesture(event)?.cancel();  // a click would open the field below the mouse
        this.toggle(pressed.item, pressed.before);
      } else if (event.button === 0) this.clear();
    }
    this.pressed = null;
  }

  private toggle(item: Item, before: Item | null): void {
    const now = new Set(this.selectedItems);
    if (!now.size && before && before !== item) now.add(before);
    if (!now.delete(item)) now.add(item);
    this.select(now);
    if (now.has(item)) Blockly.getFocusManager().focusNode(item);
  }
}

function isItem(item: unknown): item is Item {
  return item instanceof Blockly.BlockSvg || isNote(item);
}

function setSelectedStyle(item: Item, isSelected: boolean): void {
  if (isNote(item)) item.getSvgRoot().classList.toggle('nepChosen', isSelected);
  else pathOf(item)?.setMultiSelected(isSelected);
}

function blocksIn(items: readonly Item[]): Block[] {
  return items.filter((item): item is Block => !isNote(item));
}

function getNonShadowBlock(block: Block): Block {
  let real = block;
  while (real.isShadow() && real.getParent()) real = real.getParent()!;
  return real;
}

/** In the order of reading; what is inside another chosen one goes with it anyway. */
function getOutermostBlocks(blocks: ReadonlySet<Block>): Block[] {
  if (blocks.size < 2) return [...blocks];
  const outermost: Block[] = [];
  const [first] = blocks;
  const walk = (block: Block | null) => {
    for (let current = block; current; current = current.getNextBlock()) {
      if (blocks.has(current)) outermost.push(current);
      else for (const child of current.getChildren(true)) if (child !== current.getNextBlock()) walk(child);
    }
  };
  for (const top of first?.workspace.getTopBlocks(true) ?? []) walk(top);
  return outermost;
}

/** All blocks and notes that are chosen together with this one; none when it is not one of several. */
export function getSelectedItemsWith(item: Item | null | undefined): Item[] {
  const selection = item ? selections.get(item.workspace) : undefined;
  return selection?.findSelectedAncestor(item ?? null) ? selection.items : [];
}

/** The blocks among them. */
export function getSelectedBlocksWith(item: Item | null | undefined): Block[] {
  return blocksIn(getSelectedItemsWith(item));
}

/** The notes among them. */
export function getSelectedNotesWith(item: Item | null | undefined): Note[] {
  return getSelectedItemsWith(item).filter(isNote);
}

export function selectionOf(workspace: Blockly.Workspace): Selection | undefined {
  return selections.get(workspace);
}

/** Chosen blocks that hang below each other, together; the topmost first. */
export function groupIntoStacks(blocks: readonly Block[]): Block[][] {
  const selected = new Set(blocks);
  return blocks.filter((block) => !selected.has(block.getPreviousBlock() as Block) || block.getPreviousBlock()?.getNextBlock() !== block)
    .map((first) => {
      const run: Block[] = [];
      for (let current: Block | null = first; current && selected.has(current); current = current.getNextBlock()) run.push(current);
      return run;
    });
}

/** How many blocks a person sees in them: grey values in gaps are none. */
export function countBlocks(blocks: readonly Block[]): number {
  let count = 0;
  for (const block of blocks) {
    const below = new Set(block.getNextBlock()?.getDescendants(false) ?? []);
    count += block.getDescendants(false).filter((descendant) => !descendant.isShadow() && !below.has(descendant)).length;
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
    const bottom = y + (holds ? Math.min(block.height, HEADER_HEIGHT) : block.height);
    areas.push({item: block, left: x, top: y, right: x + block.childlessWidth, bottom});
    if (!holds) return;
    for (const input of block.inputList) {
      if (input.type === Blockly.inputs.inputTypes.STATEMENT) walk(input.connection?.targetBlock() as Block | null);
    }
  };
  const walk = (first: Block | null) => {
    for (let block = first; block; block = block.getNextBlock()) if (!block.isShadow()) add(block);
  };
  for (const top of workspace.getTopBlocks(true)) walk(top);
  for (const item of workspace.getTopComments().filter(isNote)) {
    const {left, top, right, bottom} = item.getBoundingRectangle();
    areas.push({item, left, top, right, bottom});
  }
  return areas;
}

const baseOnNodeFocus = Blockly.BlockSvg.prototype.onNodeFocus;
Blockly.BlockSvg.prototype.onNodeFocus = function (this: Block) {
  baseOnNodeFocus.call(this);
  selections.get(this.workspace)?.onFocus(this);
};

const baseNoteOnNodeFocus = Blockly.comments.RenderedWorkspaceComment.prototype.onNodeFocus;
Blockly.comments.RenderedWorkspaceComment.prototype.onNodeFocus = function (this: Note) {
  baseNoteOnNodeFocus.call(this);
  selections.get(this.workspace)?.onFocus(this);
};

/** Deleting one of several deletes them all, as one step; whether it was one of several. */
export function deleteSelectionWith(item: Item): boolean {
  const items = getSelectedItemsWith(item).filter((selected) => selected.isDeletable());
  if (!items.length) return false;
  const {workspace} = item;
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  workspace.hideChaff();
  removeAll(groupIntoStacks(blocksIn(items)), items.filter(isNote));
  Blockly.Events.setGroup(group);
  return true;
}

const baseCheckAndDelete = Blockly.BlockSvg.prototype.checkAndDelete;
Blockly.BlockSvg.prototype.checkAndDelete = function (this: Block) {
  if (!deleteSelectionWith(this)) baseCheckAndDelete.call(this);
};

/** Blockly's key deletes only the note that has the keys. */
export function deleteByKey(): boolean {
  const focused = Blockly.getFocusManager().getFocusedNode();
  return isNote(focused) && deleteSelectionWith(focused);
}
