// Loads and saves the workspace as JSON and notifies the window of edits.
import * as Blockly from 'blockly/core';
import {withoutTypeChecks} from './checker';
import {send} from './channel';
import type {Culling} from './culling';
import {findFreePosition, separateColumns, visibleArea, obstacles} from './free_place';
import {type BlockState, UNKNOWN_BLOCK, wrapUnknown, wrapWholeStack, unwrapUnknown} from './unknown_blocks';
import {NamelessVariables} from './nameless_variables';
import {flushTypedText} from './notes';
import {withDeferredAria} from './blockly_patches';

type Json = Record<string, unknown>;

/** Tab of a program. */
export interface ProgramTab {
  readonly key: string;
  readonly generation: number;
  readonly isActive: boolean;
}

const DEBOUNCE_MS = 150;
/**
 * Top-level key of the example files, whose scripts can overlap because translated texts are longer: after loading,
 * the editor moves these scripts apart. The key isn't saved with the new positions.
 */
const SEPARATE_SCRIPTS_KEY = 'separateScripts';

export class Program {
  /** Top-level keys of the file without a Blockly serializer; saved unchanged. */
  private rest: Json = {};
  private lastNotifiedJson = '';
  private timer = 0;
  private lastNotifiedHistory = 'false false';
  private isLoading = false;
  private readonly nameless: NamelessVariables;

  constructor(private readonly workspace: Blockly.WorkspaceSvg, private readonly culling: Culling,
    private readonly tab: ProgramTab, private readonly onSent: () => void) {
    this.nameless = new NamelessVariables(workspace);
    workspace.addChangeListener((event) => this.onEvent(event));
  }

  /** Loads a document and clears the undo history. */
  load(state: Json): void {
    this.replace(state);
    this.workspace.clearUndo();
    window.clearTimeout(this.timer);
    this.timer = 0;
    this.lastNotifiedJson = JSON.stringify(this.save());
    this.notifyHistory();
    this.scrollToStart();
    this.culling.update();
  }

  /** Replaces the blocks as one undoable edit; the scroll position stays. */
  change(state: Json): void {
    this.flush();
    const {scrollX, scrollY} = this.workspace;
    const before = new Set(this.workspace.getTopBlocks(false).map((block) => block.id));
    const group = Blockly.Events.getGroup();
    Blockly.Events.setGroup(true);
    try {
      this.loadBlocks(state, {recordUndo: true});
      this.workspace.scroll(scrollX, scrollY);
      this.lastNotifiedJson = JSON.stringify(this.save());  // the edit comes from the window
      const newBlocks = this.workspace.getTopBlocks(false).filter((block) => !before.has(block.id));
      const [only] = newBlocks;
      if (before.size && only && newBlocks.length === 1) this.moveIntoView(only);
    } finally {
      Blockly.Events.setGroup(group);
    }
  }

  /** Moves a new script to a free, visible position: the window knows neither the viewport nor the block sizes. */
  private moveIntoView(block: Blockly.BlockSvg): void {
    Blockly.renderManagement.triggerQueuedRenders(this.workspace);
    const box = block.getBoundingRectangle();
    const size = {width: box.getWidth(), height: box.getHeight()};
    const view = visibleArea(this.workspace);
    const position = findFreePosition(new Blockly.utils.Coordinate(box.left, box.top), size,
      obstacles(this.workspace, new Set([block])), view);
    if (position.x !== box.left || position.y !== box.top) {
      block.moveBy(position.x - box.left, position.y - box.top);
      this.scheduleFlush();
    }
    const now = block.getRelativeToSurfaceXY();
    if (!view.contains(now.x, now.y)) this.workspace.centerOnBlock(block.id, true);
  }

  /** Stops all notifications. */
  dispose(): void {
    window.clearTimeout(this.timer);
    this.isLoading = true;
  }

  /** Recreates the blocks after their definitions changed; keeps the undo history, scroll position and selection. */
  rebuild(): void {
    const {scrollX, scrollY} = this.workspace;
    const selected = Blockly.common.getSelected();
    const id = selected instanceof Blockly.BlockSvg ? selected.id : '';
    this.replace(this.save());
    this.workspace.scroll(scrollX, scrollY);
    const block = id ? this.workspace.getBlockById(id) : null;
    if (block) Blockly.common.setSelected(block);
  }

  /** Undoes or redoes an edit, after the edits of this frame have reached Blockly's undo stack. */
  undo(redo: boolean): void {
    window.requestAnimationFrame(() => window.setTimeout(() => {
      this.workspace.undo(redo);
      this.notifyHistory();
    }));
  }

  save(): Json {
    const state = Blockly.serialization.workspaces.save(this.workspace) as Json;
    const blocks = state['blocks'] as {blocks: BlockState[]} | undefined;
    if (blocks) state['blocks'] = {...blocks, blocks: blocks.blocks.map(unwrapUnknown)};
    return {...this.rest, ...this.nameless.omitPlaceholders(state)};
  }

  /** Returns the current JSON; notifies the window immediately if it has changed. */
  flush(): string {
    flushTypedText();
    window.clearTimeout(this.timer);
    this.timer = 0;
    const json = JSON.stringify(this.save());
    if (json !== this.lastNotifiedJson) {
      this.lastNotifiedJson = json;
      const {key, generation} = this.tab;
      send({type: 'workspaceEdited', key, generation, workspace: json});
      this.onSent();
    }
    return json;
  }

  /** Schedules a notification of a change that isn't a block edit and isn't on the undo stack. */
  scheduleFlush(): void {
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.flush(), DEBOUNCE_MS);
  }

  /** Scrolls the top left corner of the blocks near that of the viewport. */
  scrollToStart(): void {
    const blocks = this.workspace.getTopBlocks(false);
    if (!blocks.length) {
      this.workspace.scroll(0, 0);
      return;
    }
    Blockly.renderManagement.triggerQueuedRenders();
    const box = this.workspace.getBlocksBoundingBox();
    const scale = this.workspace.scale;
    this.workspace.scroll(29 - box.left * scale, 23 - box.top * scale);
  }

  private replace(state: Json): void {
    this.isLoading = true;
    Blockly.Events.disable();
    try {
      this.loadBlocks(state);
    } finally {
      Blockly.Events.enable();
      this.isLoading = false;
    }
  }

  private loadBlocks(state: Json, options: {recordUndo?: boolean} = {}): void {
    const {blocks, [SEPARATE_SCRIPTS_KEY]: separateScripts, ...others} = state;
    const tops = (blocks as {blocks?: unknown} | undefined)?.blocks;
    this.rest = Object.fromEntries(Object.entries(others).filter(([name]) =>
      !Blockly.registry.hasItem(Blockly.registry.Type.SERIALIZER, name)));
    // Update the scrollbars once, not per block, and cache the widths of equal texts.
    this.workspace.setResizesEnabled(false);
    Blockly.utils.dom.startTextWidthCache();
    try {
      this.loadOthers(others, options);
      this.nameless.create(Array.isArray(tops) ? tops as BlockState[] : []);
      this.workspace.setResizesEnabled(false);
      withoutTypeChecks(() => withDeferredAria(() => {
        for (const top of Array.isArray(tops) ? tops : []) this.append(top as BlockState, options);
      }));
    } finally {
      Blockly.utils.dom.stopTextWidthCache();
      this.workspace.setResizesEnabled(true);
      this.culling.scheduleUpdate();
    }
    if (separateScripts === true) separateColumns(this.workspace);
  }

  /** Clears the workspace and loads the state other than blocks (variables); saves an unreadable state unchanged. */
  private loadOthers(others: Json, options: {recordUndo?: boolean}): void {
    try {
      Blockly.serialization.workspaces.load(others, this.workspace, options);
    } catch (error) {
      console.warn(`The state can't be loaded and is saved unchanged: ${String(error)}`);
      this.workspace.clear();
      this.rest = others;
    }
  }

  private append(state: BlockState, options: {recordUndo?: boolean}): void {
    const before = this.workspace.getTopBlocks(false).length;
    try {
      Blockly.serialization.blocks.append(wrapUnknown(state) as Blockly.serialization.blocks.State, this.workspace, options);
    } catch (error) {
      console.warn(`The stack can't be created and is saved unchanged: ${String(error)}`);
      for (const block of this.workspace.getTopBlocks(false).slice(before)) block.dispose(false);
      Blockly.serialization.blocks.append(wrapWholeStack(state) as Blockly.serialization.blocks.State, this.workspace, options);
    }
    this.culling.hide(this.workspace.getTopBlocks(false).slice(before));
  }

  private onEvent(event: Blockly.Events.Abstract): void {
    if (event.isUiEvent || this.isLoading || event.type === Blockly.Events.FINISHED_LOADING) return;
    if (event.type === Blockly.Events.BLOCK_DELETE) this.dropEmptyUndoGroup(event.group);
    this.notifyHistory();
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      // The workspace is incomplete during a drag; wait until the drag ends.
      if (this.workspace.isDragging()) this.onEvent(event);
      else this.flush();
    }, DEBOUNCE_MS);
  }

  /** Removes the undo step of a block that was dragged from the toolbox and back into it. */
  private dropEmptyUndoGroup(group: string): void {
    const stack = this.workspace.getUndoStack();
    const first = group ? stack.findIndex((event) => event.group === group) : -1;
    if (first < 0) return;
    const step = stack.slice(first) as Blockly.Events.BlockBase[];
    const ids = (type: string) => step.filter((event) => event.type === type)
      .flatMap((event) => (event as Blockly.Events.BlockCreate | Blockly.Events.BlockDelete).ids ?? []);
    const createdIds = new Set(ids(Blockly.Events.BLOCK_CREATE));
    const deletedIds = new Set(ids(Blockly.Events.BLOCK_DELETE));
    const isNothing = step.every((event) => event.group === group && createdIds.has(event.blockId ?? ''));
    if (isNothing && [...createdIds].every((id) => deletedIds.has(id))) stack.splice(first);
  }

  /** Notifies the window of what can be undone and redone; `force`: even if unchanged. */
  notifyHistory(force = false): void {
    const canUndo = this.workspace.getUndoStack().length > 0;
    const canRedo = this.workspace.getRedoStack().length > 0;
    if (`${canUndo} ${canRedo}` === this.lastNotifiedHistory && !force) return;
    this.lastNotifiedHistory = `${canUndo} ${canRedo}`;
    if (this.tab.isActive) send({type: 'historyChanged', canUndo, canRedo});
  }
}

/** Returns true if the workspace contains a block of these types, or an unknown block whose original type is one. */
export function hasBlockOfTypes(workspace: Blockly.Workspace, types: ReadonlySet<string>): boolean {
  return workspace.getAllBlocks(false).some((block) => types.has(block.type) ||
    (block.type === UNKNOWN_BLOCK && unknownBlockMatches(block, types)));
}

function unknownBlockMatches(block: Blockly.Block, types: ReadonlySet<string>): boolean {
  const state = block.saveExtraState?.() as {original?: {type?: string}; whole?: boolean} | undefined;
  return state?.whole === true || types.has(state?.original?.type ?? '');
}
