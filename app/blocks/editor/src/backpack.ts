// Backpack: stacks of blocks kept for other files, other instances of Studio and the next start. The window
// stores the contents (`app/core/projects/backpack.py`); all behaviours share them.
import * as Blockly from 'blockly/core';
import {countBlocks} from './bin';
import {send} from './channel';
import {withoutTypeChecks} from './checker';
import {type CopiedItem, type CopiedBlocks, pasteItems, stateOf, stateOfRun} from './clipboard';
import {visibleArea} from './free_place';
import {focusedBlock} from './help';
import {drawIcon, iconElement} from './icons';
import {ctrl} from './keys';
import {ADD_TO_BACKPACK, registerBackpackMenu} from './menu';
import type {BackpackItem} from './messages';
import {getSelectedBlocksWith, getSelectedNotesWith, groupIntoStacks} from './selection';
import {Sheet, disposeSheet, createSheet, sheetOf} from './sheet';
import {type BlockState, wrapUnknown, wrapWholeStack} from './unknown_blocks';
import {withLocalVariableIds} from './own_variables';
import {t} from './words';

const SVG_NS = 'http://www.w3.org/2000/svg';
/** Space to the left of each stack for its remove button, in workspace units of the sheet. */
const GUTTER = 40;
const BUTTON_SIZE = 30;
const RETRY_MS = 60;

type BlockInfo = Blockly.utils.toolbox.BlockInfo;

let contents: readonly BackpackItem[] = [];
let button: HTMLButtonElement | null = null;
const backpacks = new Set<Backpack>();

/** Returns the backpack button, which is next to the bin and shared by all behaviours. */
export function backpackButton(): HTMLButtonElement {
  if (button) return button;
  button = document.createElement('button');
  button.type = 'button';
  button.className = 'nepBackpack';
  button.append(iconElement('backpack', 18));
  updateButton();
  return button;
}

/** Updates the button's label with the number of stacks. */
function updateButton(): void {
  const count = contents.length;
  const label = count ? t('Backpack ({count})', {count}) : t('Backpack: stores blocks to use in other files');
  if (!button) return;
  button.title = label;
  button.setAttribute('aria-label', label);
  button.classList.toggle('nepFull', count > 0);
}

/** Sets the contents of the backpack, newest first, as reported by the window. */
export function setBackpackContents(items: readonly BackpackItem[]): void {
  contents = items;
  updateButton();
  for (const backpack of backpacks) backpack.refresh();
}

/** Returns true if dropping blocks here adds them to the backpack. */
export function isOverBackpack({x, y}: {x: number; y: number}): boolean {
  const box = button?.getBoundingClientRect();
  return box !== undefined && box.width > 0 && x >= box.left && x < box.right && y >= box.top && y < box.bottom;
}

/** Highlights the button while a drop would add the dragged blocks to the backpack. */
export function highlightBackpack(isOver: boolean): void {
  button?.classList.toggle('nepOver', isOver);
}

/** Returns true if this block is shown in the backpack's sheet. */
export function isInBackpack(block: Blockly.Block): boolean {
  return sheetOf(block) instanceof BackpackSheet;
}

export function addToBackpack(copied: CopiedItem | CopiedBlocks): void {
  if (copied.nepStudio === 'note') return;
  const hasNotes = copied.nepStudio === 'blocks' && Boolean(copied.notes?.length);
  const states = copied.nepStudio === 'blocks' ? copied.states : [copied.state];
  const blocks = states.map(({id: _id, x: _x, y: _y, ...rest}) => rest as BlockState);
  const count = blocks.reduce((sum, block) => sum + countBlocks(block as Blockly.serialization.blocks.State), 0);
  if (blocks.length) send({type: 'backpackAdded', blocks, count, hasNotes});
}

/** Adds the block and the blocks below it to the backpack, or the whole selection if the block is part of it. */
function addBlockToBackpack(block: Blockly.BlockSvg): void {
  const selected = getSelectedBlocksWith(block);
  const single = selected.length ? null : stateOf(block, true);
  const states = selected.length ? groupIntoStacks(selected).map(stateOfRun) : [single?.state ?? null];
  const notes = getSelectedNotesWith(block).map((note) => stateOf(note)?.state).filter((state) => state !== undefined);
  addToBackpack({nepStudio: 'blocks', states: states.filter((state) => state !== null), notes});
}

/** Registers the backpack's menu items and shortcut, once per page. */
export function registerBackpack(getBackpack: () => Backpack): void {
  const canAddToBackpack = (block: Blockly.BlockSvg | null | undefined): block is Blockly.BlockSvg =>
    Boolean(block) && !block!.isInFlyout && !block!.isShadow();
  Blockly.ShortcutRegistry.registry.register({
    name: ADD_TO_BACKPACK, keyCodes: [ctrl(Blockly.utils.KeyCodes.P, Blockly.utils.KeyCodes.SHIFT)], displayText: () => t('Add to backpack'),
    preconditionFn: (workspace) => !workspace.isDragging() && canAddToBackpack(focusedBlock()),
    callback: (_workspace, event) => {
      event.preventDefault();
      const block = focusedBlock();
      if (canAddToBackpack(block)) addBlockToBackpack(block);
      return true;
    },
  });
  registerBackpackMenu({
    canAdd: canAddToBackpack, add: addBlockToBackpack,
    isInBackpack, remove: (block) => sheetOf(block)?.remove(block.getRootBlock()),
    count: () => contents.length, open: () => getBackpack().toggle(true), empty: () => send({type: 'backpackEmptied'}),
  });
}

/** Inflater that shows a stack which can't be created as a grey placeholder and keeps its state unchanged. */
class TolerantBlockInflater extends Blockly.BlockFlyoutInflater {
  override createBlock({kind, ...state}: BlockInfo, workspace: Blockly.WorkspaceSvg): Blockly.BlockSvg {
    const before = new Set(workspace.getTopBlocks(false));
    const make = (blockState: BlockState) => super.createBlock({kind, ...blockState} as BlockInfo, workspace);
    try {
      return make(wrapUnknown(state as unknown as BlockState));
    } catch (error) {
      console.warn(`The stack can't be created and is kept unchanged: ${String(error)}`);
      for (const block of workspace.getTopBlocks(false)) if (!before.has(block)) block.dispose(false);
      return make(wrapWholeStack(state as unknown as BlockState));
    }
  }
}

class BackpackSheet extends Sheet {
  protected override readonly tabWidth_: number = GUTTER;
  private readonly inflater = new TolerantBlockInflater();
  private readonly ids = new Map<Blockly.BlockSvg, string>();
  onPick: (block: Blockly.BlockSvg) => void = () => undefined;

  override init(target: Blockly.WorkspaceSvg): void {
    super.init(target);
    this.svgGroup_?.classList.add('nepPacked');
    this.svgGroup_?.addEventListener('keydown', (event) => {
      const block = ['Delete', 'Backspace'].includes(event.key) ? focusedBlock() : null;
      if (!block || sheetOf(block) !== this) return;
      event.preventDefault();
      event.stopPropagation();
      this.remove(block.getRootBlock() as Blockly.BlockSvg);
    }, true);
    const empty = document.createElement('button');
    empty.type = 'button';
    empty.className = 'nepEmpty';
    empty.title = t('Empty the backpack');
    empty.setAttribute('aria-label', empty.title);
    empty.append(iconElement('trash-2', 16));
    empty.onclick = () => send({type: 'backpackEmptied'});
    this.header.lastElementChild?.before(empty);
  }

  override pick(block: Blockly.BlockSvg): void {
    this.onPick(block);
  }

  override remove(block: Blockly.BlockSvg): void {
    const id = this.ids.get(block);
    if (id !== undefined) send({type: 'backpackRemoved', id});
  }

  /** Renders the contents; keeps the scroll position and the focused place. */
  renderContents(): void {
    const flyoutWorkspace = this.getWorkspace();
    const focusedIndex = this.isVisible() ? this.focusedPlace : -1;
    const {scrollY} = flyoutWorkspace;
    const names = new Map<string, string>();
    const items = contents.map(({block}) => {
      const {id: _id, x: _x, y: _y, ...rest} = withLocalVariableIds(structuredClone(block) as BlockState, this.targetWorkspace, names);
      return {kind: 'block', ...rest};
    });
    const none = [t('The backpack is empty.'), t('Drag blocks to the backpack button'), t('to use them in other files'),
      t('and the next time you start Studio.')].map((text) => ({kind: 'label', text}));
    this.setTitle(items.length ? t('Backpack ({count})', {count: items.length}) : t('Backpack'));
    this.header.querySelector('.nepEmpty')?.toggleAttribute('hidden', !items.length);
    withoutTypeChecks(() =>
      this.show((items.length ? items : none) as unknown as Blockly.utils.toolbox.FlyoutItemInfoArray));
    const blocks = this.getContents().map((item) => item.getElement()).filter((element) => element instanceof Blockly.BlockSvg);
    this.ids.clear();
    blocks.forEach((block, number) => {
      this.ids.set(block, contents[number]?.id ?? '');
      block.getSvgRoot().append(this.createRemoveButton(block));
    });
    if (focusedIndex < 0) {
      this.scrollToStart();
      return;
    }
    flyoutWorkspace.scrollbar?.setY(-scrollY);
    const next = blocks[Math.min(focusedIndex, blocks.length - 1)];
    Blockly.getFocusManager().focusNode(next ?? this.targetWorkspace);
  }

  protected override getInflaterForType(type: string): Blockly.IFlyoutInflater | null {
    return type.toLowerCase() === 'block' ? this.inflater : super.getInflaterForType(type);
  }

  protected override get closeLabel(): string {
    return t('Close the backpack');
  }

  /** Index of the focused stack, or -1. */
  private get focusedPlace(): number {
    const block = focusedBlock()?.getRootBlock();
    return block ? [...this.ids.keys()].indexOf(block as Blockly.BlockSvg) : -1;
  }

  /** Creates the remove button of a stack; hidden from screen readers, since Delete and the menu do the same. */
  private createRemoveButton(block: Blockly.BlockSvg): SVGGElement {
    const group = document.createElementNS(SVG_NS, 'g');
    group.setAttribute('class', 'nepTakeOut');
    group.setAttribute('aria-hidden', 'true');
    group.setAttribute('transform', `translate(${-GUTTER}, 6)`);
    const title = document.createElementNS(SVG_NS, 'title');
    title.textContent = t('Remove from backpack');
    const back = document.createElementNS(SVG_NS, 'circle');
    for (const name of ['cx', 'cy', 'r']) back.setAttribute(name, String(BUTTON_SIZE / 2));
    const icon = document.createElementNS(SVG_NS, 'g');
    drawIcon(icon, 'x', 18);
    icon.setAttribute('transform', 'translate(6, 6)');
    group.append(title, back, icon);
    // Keeps the press from starting a drag of the block.
    group.addEventListener('pointerdown', (event) => {
      event.stopPropagation();
      event.preventDefault();
    });
    group.addEventListener('click', (event) => {
      event.stopPropagation();
      this.remove(block);
    });
    return group;
  }
}

/** View of the backpack in one behaviour. */
export class Backpack {
  private sheet: BackpackSheet | null = null;
  private timer = 0;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    backpacks.add(this);
  }

  dispose(): void {
    window.clearTimeout(this.timer);
    backpacks.delete(this);
    disposeSheet(this.sheet);
  }

  /** Opens or closes the sheet; `byKeyboard` moves the focus to the first stack. */
  toggle(byKeyboard: boolean): void {
    const sheet = this.sheet ??= this.createSheet();
    if (sheet.isVisible()) {
      sheet.hide();
      return;
    }
    this.workspace.hideChaff();
    sheet.renderContents();
    if (byKeyboard) sheet.focusFirst();
    send({type: 'backpackOpened'});
  }

  /** Re-renders an open sheet after the contents changed, but not during a drag, which may hold one of its blocks. */
  refresh(): void {
    window.clearTimeout(this.timer);
    if (!this.sheet?.isVisible()) return;
    if (Blockly.Gesture.inProgress()) this.timer = window.setTimeout(() => this.refresh(), RETRY_MS);
    else this.sheet.renderContents();
  }

  private createSheet(): BackpackSheet {
    const sheet = createSheet(this.workspace, (options) => new BackpackSheet(options));
    sheet.onPick = (block) => this.addToWorkspace(block);
    return sheet;
  }

  /** Adds a copy to the visible part of the canvas; the original stays in the backpack. */
  private addToWorkspace(block: Blockly.BlockSvg): void {
    const copied = stateOf(block, true);
    this.sheet?.hide();
    if (!copied) return;
    const {left, right, top, bottom} = visibleArea(this.workspace);
    const position = new Blockly.utils.Coordinate(left + (right - left) / 4, top + (bottom - top) / 4);
    pasteItems({...copied, state: withLocalVariableIds(copied.state, this.workspace)}, this.workspace, position);
  }
}
