// Bin: the blocks deleted while a behaviour is open, newest first, which can be restored.
import * as Blockly from 'blockly/core';
import {iconElement} from './icons';
import {Sheet, disposeSheet, createSheet} from './sheet';
import {t} from './words';

const MAX_ENTRIES = 50;
/** Deletions within this time are reported together. */
const DEBOUNCE_MS = 60;
const SPACING = 40;
const MAX_TRIES = 40;

type State = Blockly.serialization.blocks.State;

/** Bin button next to the zoom buttons, shared by all behaviours. */
let button: HTMLButtonElement | null = null;

export function binButton(): HTMLButtonElement {
  if (button) return button;
  button = document.createElement('button');
  button.type = 'button';
  button.className = 'nepBin';
  button.append(iconElement('trash-2', 18));
  return button;
}

/** Delete area at the button. */
class BinArea extends Blockly.DeleteArea {
  override id = 'nepBin';

  override getClientRect(): Blockly.utils.Rect | null {
    const box = binButton().getBoundingClientRect();
    return box.width ? new Blockly.utils.Rect(box.top, box.bottom, box.left, box.right) : null;
  }
}

/** Sheet that shows the deleted blocks. */
class BinSheet extends Sheet {
  onPick: (id: string) => void = () => undefined;

  override pick(block: Blockly.BlockSvg): void {
    this.onPick(block.id);
  }

  protected override get closeLabel(): string {
    return t('Close the bin');
  }
}

export interface BinListener {
  /** Called when the user has deleted this number of blocks in one action. */
  deleted(count: number): void;
  /** Called when the number of entries has changed. */
  changed(): void;
}

export class Bin {
  /** Deleted blocks, oldest first. */
  private entries: State[] = [];
  /** Restored entries by block id: such a block returns to the bin when it is deleted again, even by Redo. */
  private readonly restored = new Map<string, State>();
  private readonly creationGroups = new Map<string, string>();
  /** Ids of blocks that are being moved to another behaviour. */
  private readonly moves = new Set<string>();
  private last = {group: '', ids: [] as string[], count: 0};
  private timer = 0;
  private sheet: BinSheet | null = null;
  private readonly area = new BinArea();
  private readonly hint = document.createElement('div');

  constructor(private readonly workspace: Blockly.WorkspaceSvg, private readonly listener: BinListener) {
    workspace.addChangeListener((event) => this.onEvent(event));
    workspace.getComponentManager().addComponent({
      component: this.area, weight: 1,
      capabilities: [Blockly.ComponentManager.Capability.DELETE_AREA, Blockly.ComponentManager.Capability.DRAG_TARGET],
    });
    this.hint.className = 'nepDropHere';
    this.hint.hidden = true;
    this.hint.setAttribute('aria-hidden', 'true');
    const label = document.createElement('span');
    label.textContent = t('Drop here to delete');
    this.hint.append(iconElement('trash-2', 40), label);
    workspace.getInjectionDiv().append(this.hint);
  }

  get size(): number {
    return this.entries.length;
  }

  /** Empties the bin when other blocks are loaded. */
  clear(): void {
    this.entries = [];
    this.restored.clear();
    this.creationGroups.clear();
    this.last = {group: '', ids: [], count: 0};
    this.sheet?.hide();
    this.listener.changed();
  }

  dispose(): void {
    window.clearTimeout(this.timer);
    disposeSheet(this.sheet);
  }

  /** Marks a block that moves to another behaviour, so that its deletion here isn't recorded. */
  markAsMoved(id: string): void {
    this.moves.add(id);
  }

  /** Shows over the toolbox or on the button that dropping here deletes; null hides the hint. */
  showHint(mouse: Blockly.utils.Coordinate | null): void {
    const onButton = mouse !== null && this.area.getClientRect()?.contains(mouse.x, mouse.y) === true;
    this.hint.style.width = `${this.workspace.getMetricsManager().getAbsoluteMetrics().left}px`;
    this.hint.hidden = mouse === null || onButton;
    binButton().classList.toggle('nepOver', onButton);
  }

  /** Opens or closes the sheet; `byKeyboard` moves the focus to the latest deletion. */
  toggle(byKeyboard: boolean): void {
    const sheet = this.sheet ??= this.createSheet();
    if (sheet.isVisible()) {
      sheet.hide();
      return;
    }
    this.workspace.hideChaff();
    this.renderContents(sheet);
    if (byKeyboard) sheet.focusFirst();
  }

  /** Restores the last deletion in place; returns true if the undo stack can do it instead. */
  undoLast(): boolean {
    const stack = this.workspace.getUndoStack();
    if (stack[stack.length - 1]?.group === this.last.group) return true;  // undo restores them
    for (const id of this.last.ids) this.restore(id, true);
    return false;
  }

  /** Restores a deleted block: at its old position if `exactly`, otherwise in view at a free position. */
  restore(id: string, exactly = false): void {
    const state = this.entries.find((entry) => entry.id === id);
    this.sheet?.hide();
    if (!state) return;
    const group = Blockly.Events.getGroup();
    Blockly.Events.setGroup(group || true);
    try {
      const block = Blockly.serialization.blocks.append(structuredClone(state), this.workspace,
        {recordUndo: true}) as Blockly.BlockSvg;
      if (!exactly) this.placeInView(block);
      Blockly.getFocusManager().focusNode(block);
    } finally {
      Blockly.Events.setGroup(group);
    }
  }

  private placeInView(block: Blockly.BlockSvg): void {
    Blockly.renderManagement.triggerQueuedRenders(this.workspace);
    const view = this.workspace.getMetricsManager().getViewMetrics(true);
    const viewRect = new Blockly.utils.Rect(view.top, view.top + view.height, view.left, view.left + view.width);
    const {x, y} = block.getRelativeToSurfaceXY();
    if (!viewRect.contains(x, y) || !viewRect.contains(x + SPACING, y + SPACING)) {
      block.moveBy(view.left + SPACING - x, view.top + SPACING - y);
    }
    const others = this.workspace.getTopBlocks(false).filter((other) => other !== block)
      .map((other) => other.getBoundingRectangle());
    for (let number = 0; number < MAX_TRIES; number += 1) {
      const mine = block.getBoundingRectangle();
      const covered = others.find((rect) => rect.intersects(mine));
      if (!covered) break;
      block.moveBy(0, covered.bottom + SPACING / 2 - mine.top);
    }
    block.snapToGrid();
    const now = block.getRelativeToSurfaceXY();
    if (!viewRect.contains(now.x, now.y)) this.workspace.centerOnBlock(block.id);
  }

  private createSheet(): BinSheet {
    const sheet = createSheet(this.workspace, (options) => new BinSheet(options));
    sheet.onPick = (id) => this.restore(id);
    return sheet;
  }

  private renderContents(sheet: BinSheet): void {
    sheet.setTitle(t('Deleted blocks'));
    const none = [t('No deleted blocks yet.'), t('Deleted blocks stay here'), t('until you close the behaviour.')]
      .map((text) => ({kind: 'label', text}));
    const all = [...this.entries].reverse().map((state) => {
      const {x: _x, y: _y, ...rest} = structuredClone(state);
      return {kind: 'block', ...rest};
    });
    sheet.show((all.length ? all : none) as unknown as Blockly.utils.toolbox.FlyoutItemInfoArray);
    sheet.scrollToStart();
  }

  private onEvent(event: Blockly.Events.Abstract): void {
    if (event.type === Blockly.Events.BLOCK_CREATE) this.onCreate(event as Blockly.Events.BlockCreate);
    else if (event.type === Blockly.Events.BLOCK_DELETE) this.onDelete(event as Blockly.Events.BlockDelete);
  }

  private onCreate(event: Blockly.Events.BlockCreate): void {
    if (event.group) this.creationGroups.set(event.blockId ?? '', event.group);
    const index = this.entries.findIndex((state) => state.id === event.blockId);
    const [entry] = index >= 0 ? this.entries.splice(index, 1) : [];
    if (!entry) return;
    this.restored.set(entry.id ?? '', entry);
    this.sheet?.hide();
    this.listener.changed();
  }

  private onDelete(event: Blockly.Events.BlockDelete): void {
    const id = event.blockId ?? '';
    const state = event.oldJson;
    if (this.moves.delete(id)) return;
    // A fix that reconnects the child blocks elsewhere only rearranges them; Undo reverts it.
    if (!state || event.wasShadow || idsOf({...state, id}).some((blockId) => this.workspace.getBlockById(blockId))) return;
    const wasRestored = this.restored.delete(id);
    // A block discarded in the drag that created it is no loss, and Redo repeats an undone addition.
    const loss = event.recordUndo && (this.creationGroups.get(id) !== event.group || !event.group);
    this.creationGroups.delete(id);
    if (!loss && !wasRestored) return;
    this.entries.push({...state, id});
    this.entries.splice(0, this.entries.length - MAX_ENTRIES);
    this.refresh();
    if (loss) this.notifyDeleted(event.group, id, countBlocks(state));
  }

  private notifyDeleted(group: string, id: string, count: number): void {
    if (group !== this.last.group || !group) this.last = {group, ids: [], count: 0};
    this.last.ids.push(id);
    this.last.count += count;
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.listener.deleted(this.last.count), DEBOUNCE_MS);
  }

  private refresh(): void {
    this.listener.changed();
    if (this.sheet?.isVisible()) this.renderContents(this.sheet);
  }
}

/** Returns the ids of the block, of the blocks inside it and of those below it. */
function idsOf({id, inputs, next}: State): string[] {
  const inputBlocks = Object.values(inputs ?? {}).map((input) => input.block);
  return [id ?? '', ...[...inputBlocks, next?.block].flatMap((child) => child ? idsOf(child) : [])];
}

/** Returns the number of blocks without shadow blocks, which count as part of their parent. */
export function countBlocks(state: State): number {
  const inputBlocks = Object.values(state.inputs ?? {}).map((input) => input.block);
  return [...inputBlocks, state.next?.block].reduce((sum, child) => sum + (child ? countBlocks(child) : 0), 1);
}
