// The workspace as JSON: loading, saving, telling the window about real edits.
import * as Blockly from 'blockly/core';
import {withoutTypeChecks} from './checker';
import type {Culling} from './culling';
import {freePlace, inSight, obstacles} from './free_place';
import {type BlockState, UNKNOWN_BLOCK, wrapUnknown, wrapWholeStack, unwrapUnknown} from './unknown_blocks';
import {NamelessVariables} from './nameless_variables';
import {keepTyped} from './notes';
import {withDeferredWords} from './blockly_patches';

type Json = Record<string, unknown>;

export interface Listener {
  changed(json: string): void;
  history(canUndo: boolean, canRedo: boolean): void;
  selected(id: string): void;
}

const QUIET_MS = 150;

export class Program {
  /** Parts of the file that Blockly does not know; written back as they were. */
  private rest: Json = {};
  private told = '';
  private timer = 0;
  private historyTold = 'false false';
  private loading = false;
  private readonly nameless: NamelessVariables;

  constructor(private readonly workspace: Blockly.WorkspaceSvg, private readonly culling: Culling,
    private readonly listener: Listener) {
    this.nameless = new NamelessVariables(workspace);
    workspace.addChangeListener((event) => this.onEvent(event));
  }

  /** A new file: forgets the old one and its undo. */
  load(state: Json): void {
    this.replace(state);
    this.workspace.clearUndo();
    window.clearTimeout(this.timer);
    this.timer = 0;
    this.told = JSON.stringify(this.save());
    this.tellHistory();
    this.goHome();
    this.culling.look();
  }

  /** Another program in the place of this one, as one edit that undo takes back; the view stays. */
  change(state: Json): void {
    this.flush();
    const {scrollX, scrollY} = this.workspace;
    const before = new Set(this.workspace.getTopBlocks(false).map((block) => block.id));
    const group = Blockly.Events.getGroup();
    Blockly.Events.setGroup(true);
    try {
      this.fill(state, {recordUndo: true});
      this.workspace.scroll(scrollX, scrollY);
      this.told = JSON.stringify(this.save());  // the window made it
      const made = this.workspace.getTopBlocks(false).filter((block) => !before.has(block.id));
      const [only] = made;
      if (before.size && only && made.length === 1) this.layInSight(only);
    } finally {
      Blockly.Events.setGroup(group);
    }
  }

  /** A script that was added: the window knows neither what can be seen nor how wide the other scripts are. */
  private layInSight(made: Blockly.BlockSvg): void {
    Blockly.renderManagement.triggerQueuedRenders(this.workspace);
    const box = made.getBoundingRectangle();
    const size = {width: box.getWidth(), height: box.getHeight()};
    const view = inSight(this.workspace);
    const place = freePlace(new Blockly.utils.Coordinate(box.left, box.top), size,
      obstacles(this.workspace, new Set([made])), view);
    if (place.x !== box.left || place.y !== box.top) {
      made.moveBy(place.x - box.left, place.y - box.top);
      this.touched();
    }
    const now = made.getRelativeToSurfaceXY();
    if (!view.contains(now.x, now.y)) this.workspace.centerOnBlock(made.id, true);
  }

  /** Tells nothing any more. */
  dispose(): void {
    window.clearTimeout(this.timer);
    this.loading = true;
  }

  /** The same program made again (definitions changed): undo, view and selection stay. */
  rebuild(): void {
    const {scrollX, scrollY} = this.workspace;
    const selected = Blockly.common.getSelected();
    const id = selected instanceof Blockly.BlockSvg ? selected.id : '';
    this.replace(this.save());
    this.workspace.scroll(scrollX, scrollY);
    const block = id ? this.workspace.getBlockById(id) : null;
    if (block) Blockly.common.setSelected(block);
  }

  /** Undo or redo, after the edits of this frame have reached Blockly's own list of edits. */
  undo(again: boolean): void {
    window.requestAnimationFrame(() => window.setTimeout(() => {
      this.workspace.undo(again);
      this.tellHistory();
    }));
  }

  save(): Json {
    const state = Blockly.serialization.workspaces.save(this.workspace) as Json;
    const blocks = state['blocks'] as {blocks: BlockState[]} | undefined;
    if (blocks) state['blocks'] = {...blocks, blocks: blocks.blocks.map(unwrapUnknown)};
    return {...this.rest, ...this.nameless.withoutThem(state)};
  }

  /** The newest JSON; tells about it at once when the window does not have it yet. */
  flush(): string {
    keepTyped();
    window.clearTimeout(this.timer);
    this.timer = 0;
    const json = JSON.stringify(this.save());
    if (json !== this.told) {
      this.told = json;
      this.listener.changed(json);
    }
    return json;
  }

  /** Something of the behaviour has changed that is no edit of its blocks, and that undo leaves alone. */
  touched(): void {
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.flush(), QUIET_MS);
  }

  /** Puts the program's top left corner near the workspace's. */
  goHome(): void {
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
    this.loading = true;
    Blockly.Events.disable();
    try {
      this.fill(state);
    } finally {
      Blockly.Events.enable();
      this.loading = false;
    }
  }

  private fill(state: Json, how: {recordUndo?: boolean} = {}): void {
    const {blocks, ...others} = state;
    const tops = (blocks as {blocks?: unknown} | undefined)?.blocks;
    this.rest = Object.fromEntries(Object.entries(others).filter(([name]) =>
      !Blockly.registry.hasItem(Blockly.registry.Type.SERIALIZER, name)));
    // What costs at each block, once: the scrollbars, and how wide the same words are.
    this.workspace.setResizesEnabled(false);
    Blockly.utils.dom.startTextWidthCache();
    try {
      this.loadOthers(others, how);
      this.nameless.create(Array.isArray(tops) ? tops as BlockState[] : []);
      this.workspace.setResizesEnabled(false);
      withoutTypeChecks(() => withDeferredWords(() => {
        for (const top of Array.isArray(tops) ? tops : []) this.append(top as BlockState, how);
      }));
    } finally {
      Blockly.utils.dom.stopTextWidthCache();
      this.workspace.setResizesEnabled(true);
      this.culling.lookSoon();
    }
  }

  /** Clears the workspace and loads what is beside the blocks (variables); what cannot be read is kept as it is. */
  private loadOthers(others: Json, how: {recordUndo?: boolean}): void {
    try {
      Blockly.serialization.workspaces.load(others, this.workspace, how);
    } catch (error) {
      console.warn(`kept unread: ${String(error)}`);
      this.workspace.clear();
      this.rest = others;
    }
  }

  private append(state: BlockState, how: {recordUndo?: boolean}): void {
    const before = this.workspace.getTopBlocks(false).length;
    try {
      Blockly.serialization.blocks.append(wrapUnknown(state) as Blockly.serialization.blocks.State, this.workspace, how);
    } catch (error) {
      console.warn(`kept whole: ${String(error)}`);
      for (const block of this.workspace.getTopBlocks(false).slice(before)) block.dispose(false);
      Blockly.serialization.blocks.append(wrapWholeStack(state) as Blockly.serialization.blocks.State, this.workspace, how);
    }
    this.culling.hide(this.workspace.getTopBlocks(false).slice(before));
  }

  private onEvent(event: Blockly.Events.Abstract): void {
    if (event.type === Blockly.Events.SELECTED) {
      this.listener.selected((event as Blockly.Events.Selected).newElementId ?? '');
    }
    if (event.isUiEvent || this.loading || event.type === Blockly.Events.FINISHED_LOADING) return;
    if (event.type === Blockly.Events.BLOCK_DELETE) this.forgetWhatCameAndWent(event.group);
    this.tellHistory();
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      // While a block is in the hand the program is not finished: wait until it is put down.
      if (this.workspace.isDragging()) this.onEvent(event);
      else this.flush();
    }, QUIET_MS);
  }

  /** A block that was dragged out of the toolbox and back into it has changed nothing: there is nothing to undo. */
  private forgetWhatCameAndWent(group: string): void {
    const stack = this.workspace.getUndoStack();
    const first = group ? stack.findIndex((each) => each.group === group) : -1;
    if (first < 0) return;
    const step = stack.slice(first) as Blockly.Events.BlockBase[];
    const ids = (type: string) => step.filter((each) => each.type === type)
      .flatMap((each) => (each as Blockly.Events.BlockCreate | Blockly.Events.BlockDelete).ids ?? []);
    const came = new Set(ids(Blockly.Events.BLOCK_CREATE));
    const went = new Set(ids(Blockly.Events.BLOCK_DELETE));
    const isNothing = step.every((each) => each.group === group && came.has(each.blockId ?? ''));
    if (isNothing && [...came].every((id) => went.has(id))) stack.splice(first);
  }

  /** Tells what can be undone; `again`: also when that was told before. */
  tellHistory(again = false): void {
    const canUndo = this.workspace.getUndoStack().length > 0;
    const canRedo = this.workspace.getRedoStack().length > 0;
    if (`${canUndo} ${canRedo}` === this.historyTold && !again) return;
    this.historyTold = `${canUndo} ${canRedo}`;
    this.listener.history(canUndo, canRedo);
  }
}

/** Whether the workspace holds a block of one of the types, or a kept block whose own type is among them. */
export function holdsAny(workspace: Blockly.Workspace, types: ReadonlySet<string>): boolean {
  return workspace.getAllBlocks(false).some((block) => types.has(block.type) ||
    (block.type === UNKNOWN_BLOCK && keptMatches(block, types)));
}

function keptMatches(block: Blockly.Block, types: ReadonlySet<string>): boolean {
  const state = block.saveExtraState?.() as {original?: {type?: string}; whole?: boolean} | undefined;
  return state?.whole === true || types.has(state?.original?.type ?? '');
}
