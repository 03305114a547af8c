// Context menus of blocks and of the canvas: items, labels and rendering of the rows.
// To add an item, register it with Blockly and set its icon with `setMenuIcon`. Weights: 0 to 9 run, 10 to 49
// copy and paste, 50 to 79 state, 80 to 89 parts, 90 help, 99 delete; on the canvas, 70 and above are free.
import * as Blockly from 'blockly/core';
import {canHaveBreakpoint, hasBreakpoint, toggleBreakpoint} from './breakpoints';
import {send} from './channel';
import {type Clipboard} from './clipboard';
import {focusedBlock} from './help';
import {canCollapse, setCollapsed} from './folding';
import {SELECT_ALL_SHORTCUT, selectAll, registerSelectAll} from './frame';
import {iconElement} from './icons';
import {ctrl, formatShortcut} from './keys';
import {findHidden, revealBlock} from './inside_marks';
import {addCanvasNote, addNote, hasNote, removeNote} from './notes';
import {registerRemoveMenu} from './remove_menu';
import {getSelectedItemsWith, getSelectedBlocksWith, countBlocks, getSelectedNotesWith, deleteSelectionWith} from './selection';
import {t} from './words';

const {names} = Blockly.ShortcutItems;
const {ScopeType} = Blockly.ContextMenuRegistry;
const DISABLED_REASON = 'MANUALLY_DISABLED';
const TOGGLE_DISABLED = 'nepSwitch';

const REMOVED_ITEMS = ['collapseWorkspace', 'expandWorkspace', 'blockInline', 'blockHelp', 'commentCreate', 'commentDelete',
  'commentDuplicate', 'blockDuplicate', 'blockCollapseExpand', 'blockDisable', 'blockDelete', 'blockComment'];

/** Items of Blockly that are kept, with their weights and icons. */
const KEPT_ITEMS: Readonly<Record<string, [weight: number, icon: string]>> = {
  undoWorkspace: [20, 'undo-2'],
  redoWorkspace: [21, 'redo-2'],
  cleanWorkspace: [40, 'list-checks'],
  workspaceDelete: [99, 'trash-2'],
};

const icons = new Map<string, string>();

/** Sets the icon of a menu item by the item's id. */
export function setMenuIcon(id: string, icon: string): void {
  icons.set(id, icon);
}

/** Sets up the menus; call before any workspace is created. */
export function configureMenu(): void {
  registerRemoveMenu();
  const registry = Blockly.ContextMenuRegistry.registry;
  for (const id of REMOVED_ITEMS) if (registry.getItem(id)) registry.unregister(id);
  for (const [id, [weight, icon]] of Object.entries(KEPT_ITEMS)) {
    const item = registry.getItem(id);
    if (item) item.weight = weight;
    setMenuIcon(id, icon);
  }
  setMenuIcon('nepHelp', 'circle-question-mark');
  setMenuIcon('nepRemoveItem', 'list-minus');
  setMenuIcon('nepAddElseIf', 'split');
  setMenuIcon('nepAddElse', 'split');
  // Never ask for confirmation: deleting can be undone.
  Blockly.dialog.setConfirm((_message, callback) => callback(true));
}

type Scope = Blockly.ContextMenuRegistry.Scope;

interface MenuEntry {
  id: string;
  weight: number;
  icon: string;
  words: string | ((scope: Scope) => string);
  /** Name of the equivalent shortcut. */
  shortcut?: string;
  when(scope: Scope): boolean | 'disabled';
  run(scope: Scope, location: {x: number; y: number}): unknown;
}

function addMenuEntry(scopeType: Blockly.ContextMenuRegistry.ScopeType, entry: MenuEntry): void {
  const {id, weight, icon, words, shortcut} = entry;
  setMenuIcon(id, icon);
  Blockly.ContextMenuRegistry.registry.register({
    id, weight, scopeType,
    displayText: typeof words === 'string' ? words : (scope) => words(scope),
    ...(shortcut !== undefined && {associatedKeyboardShortcut: shortcut}),
    preconditionFn: (scope) => {
      const when = entry.when(scope);
      return when === 'disabled' ? when : when ? 'enabled' : 'hidden';
    },
    callback: (scope, _opened, _chosen, location) => void entry.run(scope, location),
  });
}

function addSeparator(scopeType: Blockly.ContextMenuRegistry.ScopeType, weight: number): void {
  Blockly.ContextMenuRegistry.registry.register({id: `nepLine${scopeType}${weight}`, weight, scopeType, separator: true});
}

/** Returns true if the user can edit the block of this menu. */
function isEditable({block}: Scope): boolean {
  return block !== undefined && !block.isInFlyout && !block.isShadow();
}

export function registerMenu(clipboard: Clipboard): void {
  const block = (entry: MenuEntry) => addMenuEntry(ScopeType.BLOCK, entry);
  block({id: 'nepDuplicate', weight: 10, icon: 'copy-plus', words: t('Duplicate'), shortcut: names.DUPLICATE,
    when: isEditable, run: (scope) => clipboard.duplicate(scope.block)});
  block({id: 'nepCopy', weight: 11, icon: 'copy', words: t('Copy'), shortcut: names.COPY,
    when: ({block: target}) => target !== undefined, run: (scope) => clipboard.copy(scope.block)});
  block({id: 'nepCut', weight: 12, icon: 'scissors', words: t('Cut'), shortcut: names.CUT,
    when: (scope) => isEditable(scope) && scope.block!.isDeletable(), run: (scope) => clipboard.cut(scope.block)});
  block({id: 'nepPaste', weight: 13, icon: 'clipboard-paste', words: t('Paste'), shortcut: names.PASTE,
    when: isEditable, run: (_scope, location) => clipboard.paste(location)});
  addSeparator(ScopeType.BLOCK, 50);
  block({id: 'nepCollapse', weight: 51, icon: 'fold-vertical', words: t('Collapse'),
    when: (scope) => isEditable(scope) && targetBlocks(scope.block!).some((target) => !target.isCollapsed() && canCollapse(target)),
    run: (scope) => withUndoGroup(() => targetBlocks(scope.block!).filter(canCollapse).forEach((target) => setCollapsed(target, true)))});
  block({id: 'nepExpand', weight: 52, icon: 'unfold-vertical', words: t('Expand'),
    when: (scope) => isEditable(scope) && targetBlocks(scope.block!).some((target) => target.isCollapsed()),
    run: (scope) => withUndoGroup(() => targetBlocks(scope.block!).forEach((target) => setCollapsed(target, false)))});
  block({id: 'nepOff', weight: 53, icon: 'power-off', words: t('Disable block'), shortcut: TOGGLE_DISABLED,
    when: (scope) => isEditable(scope) && targetBlocks(scope.block!).some((target) => !target.hasDisabledReason(DISABLED_REASON) && !target.getInheritedDisabled()),
    run: (scope) => setDisabled(scope.block!, true)});
  block({id: 'nepOn', weight: 54, icon: 'power', words: t('Enable block'), shortcut: TOGGLE_DISABLED,
    when: (scope) => isEditable(scope) && targetBlocks(scope.block!).some((target) => target.hasDisabledReason(DISABLED_REASON)), run: (scope) => setDisabled(scope.block!, false)});
  block({id: 'nepNote', weight: 70, icon: 'sticky-note', words: t('Add a note'),
    when: (scope) => isEditable(scope) && !hasNote(scope.block!) && !scope.block!.isCollapsed(), run: (scope) => addNote(scope.block!)});
  block({id: 'nepNoNote', weight: 70, icon: 'sticky-note', words: t('Remove the note'),
    when: (scope) => isEditable(scope) && hasNote(scope.block!), run: (scope) => removeNote(scope.block!)});
  block({id: 'nepPause', weight: 75, icon: 'circle-pause',
    words: (scope) => scope.block && hasBreakpoint(scope.block) ? t('Don\'t pause here') : t('Pause here'),
    when: (scope) => isEditable(scope) && canHaveBreakpoint(scope.block!), run: (scope) => toggleBreakpoint(scope.block!)});
  block({id: 'nepShowNote', weight: 71, icon: 'sticky-note', words: t('Show the note inside this block'),
    when: (scope) => isEditable(scope) && findHidden(scope.block!, 'note') !== null, run: (scope) => revealBlock(findHidden(scope.block!, 'note')!)});
  block({id: 'nepShowPause', weight: 76, icon: 'circle-pause', words: t('Show the pause inside this block'),
    when: (scope) => isEditable(scope) && findHidden(scope.block!, 'pause') !== null, run: (scope) => revealBlock(findHidden(scope.block!, 'pause')!)});
  addSeparator(ScopeType.BLOCK, 80);
  addSeparator(ScopeType.BLOCK, 98);
  block({id: 'nepDelete', weight: 99, icon: 'trash-2', shortcut: names.DELETE,
    words: (scope) => scope.block ? deleteLabel(scope.block) : '',
    when: (scope) => isEditable(scope) && scope.block!.isDeletable(), run: (scope) => deleteBlock(scope.block!)});

  Blockly.ShortcutRegistry.registry.register({
    name: TOGGLE_DISABLED, keyCodes: [ctrl(Blockly.utils.KeyCodes.E)], displayText: () => t('Disable or enable the block'),
    preconditionFn: (workspace) => !workspace.isDragging() && !workspace.isFlyout,
    callback: () => {
      const focused = focusedBlock();
      if (!focused || focused.isInFlyout || focused.getInheritedDisabled()) return false;
      setDisabled(focused, !focused.hasDisabledReason(DISABLED_REASON));
      return true;
    },
  });

  registerSelectAll();
  addMenuEntry(ScopeType.WORKSPACE, {id: 'nepChooseAll', weight: 12, icon: 'square-dashed-mouse-pointer', words: t('Select all'),
    shortcut: SELECT_ALL_SHORTCUT,
    when: ({workspace}) => (workspace ? workspace.getTopBlocks(false).length + workspace.getTopComments().length : 0) > 0,
    run: ({workspace}) => workspace && selectAll(workspace)});
  addMenuEntry(ScopeType.WORKSPACE, {id: 'nepPasteHere', weight: 10, icon: 'clipboard-paste', words: t('Paste'),
    shortcut: names.PASTE, when: () => true, run: (_scope, location) => clipboard.paste(location)});
  addSeparator(ScopeType.WORKSPACE, 15);
  addSeparator(ScopeType.WORKSPACE, 35);
  addMenuEntry(ScopeType.WORKSPACE, {id: 'nepNoteHere', weight: 50, icon: 'sticky-note', words: t('Add a note here'),
    when: () => true, run: (scope, location) => scope.workspace && addCanvasNote(scope.workspace, location)});
  addSeparator(ScopeType.WORKSPACE, 98);

  const note = (entry: MenuEntry) => addMenuEntry(ScopeType.COMMENT, entry);
  note({id: 'nepNoteDuplicate', weight: 10, icon: 'copy-plus', words: t('Duplicate'), shortcut: names.DUPLICATE,
    when: () => true, run: (scope) => clipboard.duplicate(scope.comment)});
  note({id: 'nepNoteCopy', weight: 11, icon: 'copy', words: t('Copy'), shortcut: names.COPY,
    when: () => true, run: (scope) => clipboard.copy(scope.comment)});
  note({id: 'nepNoteDelete', weight: 99, icon: 'trash-2', shortcut: names.DELETE,
    words: (scope) => getSelectedItemsWith(scope.comment).length ? t('Delete the selection') : t('Remove the note'),
    when: () => true, run: (scope) => scope.comment && !deleteSelectionWith(scope.comment) && withUndoGroup(() => scope.comment!.dispose())});
}

/** Name of the shortcut that adds blocks to the backpack. */
export const ADD_TO_BACKPACK = 'nepPack';

/** Backpack operations that the menus use. */
interface BackpackActions {
  canAdd(block: Blockly.BlockSvg | undefined): boolean;
  add(block: Blockly.BlockSvg): void;
  isInBackpack(block: Blockly.BlockSvg): boolean;
  remove(block: Blockly.BlockSvg): void;
  count(): number;
  open(): void;
  empty(): void;
}

export function registerBackpackMenu(backpack: BackpackActions): void {
  addMenuEntry(ScopeType.BLOCK, {id: 'nepPack', weight: 14, icon: 'backpack', words: t('Add to backpack'), shortcut: ADD_TO_BACKPACK,
    when: ({block}) => backpack.canAdd(block), run: ({block}) => block && backpack.add(block)});
  addMenuEntry(ScopeType.BLOCK, {id: 'nepUnpack', weight: 99, icon: 'trash-2', words: t('Remove from backpack'),
    shortcut: names.DELETE, when: ({block}) => block !== undefined && backpack.isInBackpack(block),
    run: ({block}) => block && backpack.remove(block)});
  addMenuEntry(ScopeType.WORKSPACE, {id: 'nepOpenBackpack', weight: 13, icon: 'backpack',
    words: () => t('Open the backpack ({count})', {count: backpack.count()}),
    when: () => backpack.count() > 0, run: () => backpack.open()});
  addMenuEntry(ScopeType.WORKSPACE, {id: 'nepEmptyBackpack', weight: 14, icon: 'trash-2', words: t('Empty the backpack'),
    when: () => backpack.count() > 0, run: () => backpack.empty()});
}

export function registerPictureMenu(): void {
  const command = (name: string) => send({type: 'commandRequested', command: name});
  const canvas = (entry: Omit<MenuEntry, 'when'>) => addMenuEntry(ScopeType.WORKSPACE,
    {...entry, when: ({workspace}) => (workspace?.getTopBlocks(false).length ?? 0) > 0});
  addSeparator(ScopeType.WORKSPACE, 60);
  canvas({id: 'nepPicture', weight: 61, icon: 'image-down', words: t('Save as image'), run: () => command('picture.save')});
  canvas({id: 'nepCopyPicture', weight: 62, icon: 'image', words: t('Copy as image'), run: () => command('picture.copy')});
  canvas({id: 'nepPrintBlocks', weight: 63, icon: 'printer', words: t('Print'), run: () => command('print.ask')});
}

// ---- state of a block

/** Disables or enables a block, so that the program skips it; an event block includes its whole script. */
export function setDisabled(block: Blockly.BlockSvg, isDisabled: boolean): void {
  const selected = getSelectedBlocksWith(block);
  withUndoGroup(() => {
    for (const selectedBlock of selected) selectedBlock.setDisabledReason(isDisabled, DISABLED_REASON);
    if (selected.length) return;
    const starts = !block.previousConnection && !block.outputConnection;
    for (let current: Blockly.BlockSvg | null = block; current; current = starts ? current.getNextBlock() : null) {
      current.setDisabledReason(isDisabled, DISABLED_REASON);
    }
  });
}

function withUndoGroup(change: () => void): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  change();
  Blockly.Events.setGroup(group);
}

function deleteLabel(block: Blockly.BlockSvg): string {
  if (getSelectedNotesWith(block).length) return t('Delete the selection');
  const count = countBlocks(targetBlocks(block));
  return count === 1 ? Blockly.Msg['DELETE_BLOCK'] ?? '' :
    (Blockly.Msg['DELETE_X_BLOCKS'] ?? '').replace('%1', String(count));
}

/** Returns the block of a menu, or the selection that contains it. */
function targetBlocks(block: Blockly.BlockSvg): Blockly.BlockSvg[] {
  const selected = getSelectedBlocksWith(block);
  return selected.length ? selected : [block];
}

/** Items that apply to several blocks; the others are hidden in a multiple selection. */
const MULTI_BLOCK_ITEMS = new Set(['nepDuplicate', 'nepCopy', 'nepCut', 'nepPaste', 'nepCollapse', 'nepExpand', 'nepOff', 'nepOn', 'nepDelete', 'nepPack']);

/** Shows a menu item for a multiple selection as well; its action has to handle all selected blocks. */
export function enableForMultiSelection(id: string): void {
  MULTI_BLOCK_ITEMS.add(id);
}

function deleteBlock(block: Blockly.BlockSvg): void {
  Blockly.getFocusManager().focusNode(block);
  block.checkAndDelete();
}

// ---- rendering of a row

function createRow(icon: string, text: string, keys: string): HTMLElement {
  const element = document.createElement('div');
  element.className = 'nepMenuRow';
  const label = document.createElement('span');
  label.textContent = text;
  const picture = document.createElement('i');
  if (icon) picture.append(iconElement(icon, 18, 1.75));
  element.append(picture, label);
  if (keys) {
    const hint = document.createElement('kbd');
    hint.textContent = keys;
    element.append(hint);
  }
  return element;
}

type Option = Blockly.ContextMenuRegistry.ContextMenuOption;

/** Removes separators at the ends, and repeated ones where all items between them are hidden. */
function withoutExtraSeparators(options: Option[]): Option[] {
  const first = options.findIndex((option) => !option.separator);
  const isBeforeSeparator = (index: number) => index + 1 === options.length || options[index + 1]?.separator === true;
  return options.filter((option, index) => !option.separator || (index > first && !isBeforeSeparator(index)));
}

const registryPrototype = Blockly.ContextMenuRegistry.prototype;
const originalGetContextMenuOptions = registryPrototype.getContextMenuOptions;
registryPrototype.getContextMenuOptions = function (scope, event) {
  const several = getSelectedItemsWith(scope.block as Blockly.BlockSvg | undefined).length > 0;
  const options = originalGetContextMenuOptions.call(this, scope, event).filter((option) => option.separator || !several || MULTI_BLOCK_ITEMS.has(option.id));
  for (const option of options) {
    if (option.separator || typeof option.text !== 'string') continue;
    const {associatedKeyboardShortcut: shortcut} = option;
    option.text = createRow(icons.get(option.id) ?? '', option.text, shortcut ? formatShortcut(shortcut) : '');
  }
  return withoutExtraSeparators(options);
};
