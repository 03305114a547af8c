// Selection of several blocks and notes: all of them, with a marquee, or with Ctrl or Shift and a click.
// A selected block includes its children; blocks below it are selected only if they have
// an outline of their own. Only notes of the canvas can be selected, not comments of blocks.
import * as Blockly from 'blockly/core';
import {removeAll} from './carry';
import {pathOf} from './renderer';

type Block = Blockly.BlockSvg;
export type Note = Blockly.comments.RenderedWorkspaceComment;
/** An element that can be selected. */
export type Item = Block | Note;

export function isNote(item: unknown): item is Note {
  return item instanceof Blockly.comments.RenderedWorkspaceComment;
}

/** Maximum distance between press and release of a click, in pixels. */
const CLICK_TOLERANCE_PX = 5;
/** Height of a container block's header: a marquee that touches it selects the block, below it the children. */
const HEADER_HEIGHT = 48;

const selections = new WeakMap<Blockly.Workspace, Selection>();

export class Selection {
  private selectedItems = new Set<Item>();
  /** Pointer press on an item that may become a click. */
  private pressed: {x: number; y: number; item: Item; isToggle: boolean; before: Item | null} | null = null;

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

  /** The selected items if there are several, else none: blocks in reading order, then notes. */
  get items(): Item[] {
    if ([...this.selectedItems].some((item) => item.isDeadOrDying())) this.setSelectedItems([...this.selectedItems].filter((item) => !item.isDeadOrDying()));
    return this.selectedItems.size > 1 ? [...this.selectedItems] : [];
  }

  /** Selects exactly these items and focuses the first one unless one of them has the focus. */
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

  /** Highlights the selected items without moving the focus, as while a marquee is drawn. */
  setSelectedItems(items: Iterable<Item>): void {
    const now = new Set(items);
    for (const item of this.selectedItems) if (!now.has(item) && !item.isDeadOrDying()) setSelectedStyle(item, false);
    for (const item of now) if (!this.selectedItems.has(item)) setSelectedStyle(item, true);
    this.selectedItems = now;
  }

  clear(): void {
    if (this.selectedItems.size) this.setSelectedItems([]);
  }

  /** Returns the item itself or the surrounding block that is part of the selection. */
  findSelectedAncestor(item: Item | null): Item | null {
    if (isNote(item)) return this.selectedItems.has(item) ? item : null;
    for (let block = item; block; block = block.getSurroundParent()) if (this.selectedItems.has(block)) return block;
    return null;
  }

  /** Clears the selection when an item outside it gets the focus. */
  onFocus(item: Item): void {
    if (this.selectedItems.size && !this.pressed?.isToggle && !this.findSelectedAncestor(item)) this.clear();
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
      isToggle: event.shiftKey || event.ctrlKey || event.metaKey,
      before: isItem(before) && before.workspace === this.workspace ? before : null};
  }

  private onUp(event: PointerEvent): void {
    const {pressed} = this;
    if (!pressed) return;
    const isClick = Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) < CLICK_TOLERANCE_PX;
    if (isClick && !this.workspace.isDragging()) {
      if (pressed.isToggle) {
        this.workspace.getGesture(event)?.cancel();  // a click would open the field under the pointer
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

/** Returns the blocks that aren't inside another of them, in reading order. */
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

/** Returns all selected blocks and notes if this item is one of several, else none. */
export function getSelectedItemsWith(item: Item | null | undefined): Item[] {
  const selection = item ? selections.get(item.workspace) : undefined;
  return selection?.findSelectedAncestor(item ?? null) ? selection.items : [];
}

/** Returns the selected blocks if this item is one of several. */
export function getSelectedBlocksWith(item: Item | null | undefined): Block[] {
  return blocksIn(getSelectedItemsWith(item));
}

/** Returns the selected notes if this item is one of several. */
export function getSelectedNotesWith(item: Item | null | undefined): Note[] {
  return getSelectedItemsWith(item).filter(isNote);
}

export function selectionOf(workspace: Blockly.Workspace): Selection | undefined {
  return selections.get(workspace);
}

/** Groups selected blocks that are connected below each other; the topmost comes first. */
export function groupIntoStacks(blocks: readonly Block[]): Block[][] {
  const selected = new Set(blocks);
  return blocks.filter((block) => !selected.has(block.getPreviousBlock() as Block) || block.getPreviousBlock()?.getNextBlock() !== block)
    .map((first) => {
      const run: Block[] = [];
      for (let current: Block | null = first; current && selected.has(current); current = current.getNextBlock()) run.push(current);
      return run;
    });
}

/** Returns the number of blocks including their children, without shadow blocks. */
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

/** Returns the areas in which a marquee selects each block and note, in workspace units. */
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

/** Deletes the whole selection as one undo step; returns false if the item isn't one of several. */
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

/** Deletes the selection when a note has the focus; Blockly's shortcut would delete only that note. */
export function deleteByKey(): boolean {
  const focused = Blockly.getFocusManager().getFocusedNode();
  return isNote(focused) && deleteSelectionWith(focused);
}
