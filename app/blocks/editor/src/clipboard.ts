// Copy, cut, paste and duplicate for blocks and notes. Copies are text on the system clipboard, so that they
// can be pasted in other tabs and instances of Studio, or sent to others. Pasted items are free and in view.
import * as Blockly from 'blockly/core';
import {send} from './channel';
import {withoutTypeChecks} from './checker';
import {findFreePosition, visibleArea, obstacles} from './free_place';
import {focusedBlock} from './help';
import {type Item, type Note, getSelectedItemsWith, getSelectedBlocksWith, getSelectedNotesWith, deleteSelectionWith, groupIntoStacks, selectionOf} from './selection';
import {type BlockState, unwrapUnknown, wrapUnknown} from './unknown_blocks';

/** Prefix of every copied text; `app/ui/blockly/host.py` checks for it. */
const JSON_PREFIX = '{"nepStudio":';

export interface CopiedItem {
  nepStudio: 'block' | 'note';
  state: BlockState;
}

/** Several scripts and notes with their relative positions. */
export interface CopiedBlocks {
  nepStudio: 'blocks';
  states: BlockState[];
  notes?: BlockState[];
}

type Point = Blockly.utils.Coordinate;

const PASTE_OFFSET = 34;

export class Clipboard {
  /** Last copy made here, pasted if the system clipboard holds anything else. */
  private copied = '';
  private mouse: {x: number; y: number} | null = null;
  /** Requests for the text of the system clipboard, which the page can't read itself. */
  private readonly requests: ((text: string) => void)[] = [];

  constructor() {
    document.addEventListener('pointermove', (event) => this.mouse = {x: event.clientX, y: event.clientY}, true);
    document.documentElement.addEventListener('pointerleave', () => this.mouse = null);
  }

  /** Copies the item or the selection; returns false if there was nothing to copy. */
  copy(item = focusedItem()): boolean {
    const copied = item && copyOf(item);
    if (!copied) return false;
    this.copied = JSON.stringify(copied);
    send({type: 'blocksCopied', text: this.copied});
    return true;
  }

  cut(item = focusedItem()): boolean {
    if (!item || item.workspace.isFlyout || !item.isDeletable() || !this.copy(item)) return false;
    if (item instanceof Blockly.BlockSvg) item.checkAndDelete();
    else if (!deleteSelectionWith(item)) withUndoGroup(() => item.dispose());
    return true;
  }

  /** Pastes a copy beside the original. */
  duplicate(item = focusedItem()): boolean {
    if (!item || item.workspace.isFlyout) return false;
    const copied = copyOf(item);
    if (copied) pasteItems(copied, item.workspace, positionBeside(item));
    return copied !== null;
  }

  /** Pastes at the given position, or else under the mouse, beside the focused block or in the visible area. */
  async paste(pagePosition: {x: number; y: number} | null = null): Promise<void> {
    const read = parseClipboard(await this.readSystemClipboard()) ?? parseClipboard(this.copied);
    if (!read) return;
    const workspace = Blockly.common.getMainWorkspace() as Blockly.WorkspaceSvg;
    pasteItems(read, workspace, pagePosition ? toWorkspaceCoordinates(workspace, pagePosition) : this.pastePosition(workspace));
  }

  /** Handles the reply of the window to the oldest request. */
  receive(text: string): void {
    this.requests.shift()?.(text);
  }

  private readSystemClipboard(): Promise<string> {
    return new Promise((resolve) => {
      this.requests.push(resolve);
      send({type: 'clipboardRequested'});
    });
  }

  private pastePosition(workspace: Blockly.WorkspaceSvg): Point {
    const block = focusedBlock();
    const byKeys = Blockly.keyboardNavigationController.getIsActive();
    if (!byKeys && this.mouse && isOverCanvas(workspace, this.mouse)) return toWorkspaceCoordinates(workspace, this.mouse);
    if (block && block.workspace === workspace) return positionBeside(block);
    const {left, right, top, bottom} = visibleArea(workspace);
    return new Blockly.utils.Coordinate(left + (right - left) / 3, top + (bottom - top) / 3);
  }
}

/** Returns the focused block or note; a focused field or slot counts as its block. */
export function focusedItem(): Item | null {
  const node = Blockly.getFocusManager().getFocusedNode();
  return node instanceof Blockly.comments.RenderedWorkspaceComment ? node : focusedBlock();
}

/** Returns the state of an item; `includeBelow`: with the blocks below it. */
export function stateOf(item: Item, includeBelow = false): CopiedItem | null {
  const data = item.toCopyData(includeBelow) as {blockState?: unknown; commentState?: unknown} | null;
  if (data?.blockState) return {nepStudio: 'block', state: unwrapUnknown(data.blockState as BlockState)};
  return data?.commentState ? {nepStudio: 'note', state: data.commentState as BlockState} : null;
}

/** Returns a copy of the item, or of the selection that contains it. */
function copyOf(item: Item): CopiedItem | CopiedBlocks | null {
  if (!getSelectedItemsWith(item).length) return stateOf(item);
  const copied = copyOfAll(groupIntoStacks(getSelectedBlocksWith(item)), getSelectedNotesWith(item));
  const [only, ...more] = copied.states;
  return only && !more.length && !copied.notes ? {nepStudio: 'block', state: only} : copied;
}

export function copyOfAll(runs: readonly Blockly.BlockSvg[][], notes: readonly Note[]): CopiedBlocks {
  const states = runs.map(stateOfRun).filter((state) => state !== null);
  const noteStates = notes.map((note) => stateOf(note)?.state).filter((state) => state !== undefined);
  return {nepStudio: 'blocks', states, ...(noteStates.length && {notes: noteStates})};
}

/** Returns the state of consecutive blocks, without the unselected blocks below them. */
export function stateOfRun(run: readonly Blockly.BlockSvg[]): BlockState | null {
  let state: BlockState | null = null;
  for (const block of [...run].reverse()) {
    const copied = stateOf(block);
    if (copied) state = state ? {...copied.state, next: {block: withoutPosition(state)}} : copied.state;
  }
  return state;
}

function withoutPosition({x: _x, y: _y, ...rest}: BlockState): BlockState {
  return rest as BlockState;
}

/** Parses clipboard text; null if it isn't ours. The source is untrusted: creating the blocks may still fail. */
function parseClipboard(text: string): CopiedItem | CopiedBlocks | null {
  if (!text.startsWith(JSON_PREFIX)) return null;
  try {
    const {nepStudio, state, states, notes} = JSON.parse(text) as CopiedItem & {states?: unknown; notes?: unknown};
    if ((nepStudio as string) === 'blocks') {
      const validBlocks = (Array.isArray(states) ? states as unknown[] : []).filter(isBlock);
      const validNotes = (Array.isArray(notes) ? notes as unknown[] : []).filter(isState);
      return validBlocks.length || validNotes.length ? {nepStudio: 'blocks', states: validBlocks, ...(validNotes.length && {notes: validNotes})} : null;
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

function toWorkspaceCoordinates(workspace: Blockly.WorkspaceSvg, {x, y}: {x: number; y: number}): Point {
  return Blockly.utils.svgMath.screenToWsCoordinates(workspace, new Blockly.utils.Coordinate(x, y));
}

/** Returns true if the point is over the canvas itself and not over the toolbox, flyout or an overlay. */
function isOverCanvas(workspace: Blockly.WorkspaceSvg, {x, y}: {x: number; y: number}): boolean {
  const under = document.elementFromPoint(x, y);
  return under !== null && workspace.getParentSvg().contains(under) && !under.closest('.blocklyFlyout');
}

/** Returns the position to the right of the item's stack, at the height of the item. */
function positionBeside(item: Item): Point {
  const stack = item instanceof Blockly.BlockSvg ? item.getRootBlock() : item;
  const {right} = (stack as Blockly.IBoundedElement).getBoundingRectangle();
  return new Blockly.utils.Coordinate(right + PASTE_OFFSET, item.getRelativeToSurfaceXY().y);
}

export function withUndoGroup<T>(change: () => T): T {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  try {
    return change();
  } finally {
    Blockly.Events.setGroup(group);
  }
}

/** Creates the items in one undo step at a free position and focuses the first; returns [] if that fails. */
export function pasteItems(copied: CopiedItem | CopiedBlocks, workspace: Blockly.WorkspaceSvg, position: Point): Item[] {
  const existing = new Set<unknown>([...workspace.getTopBlocks(false), ...workspace.getTopComments()]);
  const {scrollX, scrollY} = workspace;
  workspace.hideChaff();
  const pasted = withUndoGroup(() => {
    try {
      return moveToFreePosition(createItems(copied, workspace, position), position);
    } catch (error) {
      console.warn(`The clipboard can't be pasted: ${String(error)}`);
      for (const item of [...workspace.getTopBlocks(false), ...workspace.getTopComments()]) {
        if (!existing.has(item)) item.dispose();
      }
      return [];
    }
  });
  workspace.scroll(scrollX, scrollY);  // keep the view where it was
  if (pasted[0]) Blockly.getFocusManager().focusNode(pasted[0]);
  if (pasted.length > 1) selectionOf(workspace)?.select(pasted.flatMap(stackItems));
  return pasted;
}

/** Returns the note, or the blocks of the stack. */
function stackItems(top: Item): Item[] {
  if (!(top instanceof Blockly.BlockSvg)) return [top];
  const blocks: Blockly.BlockSvg[] = [];
  for (let block: Blockly.BlockSvg | null = top; block; block = block.getNextBlock()) blocks.push(block);
  return blocks;
}

/** Moves the items together to a free position and keeps their layout. */
function moveToFreePosition(items: Item[], position: Point): Item[] {
  Blockly.renderManagement.triggerQueuedRenders();
  const boxes = items.map((item) => (item as Blockly.IBoundedElement).getBoundingRectangle());
  const [left, top] = [Math.min(...boxes.map((box) => box.left)), Math.min(...boxes.map((box) => box.top))];
  const size = {width: Math.max(...boxes.map((box) => box.right)) - left,
    height: Math.max(...boxes.map((box) => box.bottom)) - top};
  const [first] = items;
  if (!first) return items;
  const freePosition = findFreePosition(position, size, obstacles(first.workspace, new Set(items)), visibleArea(first.workspace));
  for (const item of items) item.moveBy(freePosition.x - left, freePosition.y - top);
  return items;
}

function createItems(copied: CopiedItem | CopiedBlocks, workspace: Blockly.WorkspaceSvg, position: Point): Item[] {
  if (copied.nepStudio !== 'blocks') return [createItem(copied, workspace, position)];
  const createFrom = (nepStudio: 'block' | 'note') => (state: BlockState) => {
    const savedPosition = new Blockly.utils.Coordinate(Number(state['x']) || 0, Number(state['y']) || 0);
    return createItem({nepStudio, state}, workspace, savedPosition);
  };
  return [...copied.states.map(createFrom('block')), ...(copied.notes ?? []).map(createFrom('note'))];
}

function createItem({nepStudio, state}: CopiedItem, workspace: Blockly.WorkspaceSvg, {x, y}: Point): Item {
  const {id, ...rest} = {...state, x, y};
  void id;
  const options = {recordUndo: true};
  if (nepStudio === 'note') {
    return Blockly.serialization.workspaceComments.append(rest, workspace, options) as unknown as Item;
  }
  const blockState = wrapUnknown(rest as BlockState) as Blockly.serialization.blocks.State;
  return withoutTypeChecks(() => Blockly.serialization.blocks.append(blockState, workspace, options) as Blockly.BlockSvg);
}
