// The menus of blocks and of the canvas: their entries, their words, and how a row looks.
// Who adds entries registers them with Blockly and names an icon with `menuIcon`. Weights: 0 to 9 what runs, 10 to 49
// copying, 50 to 79 how the block is, 80 to 89 parts of it, 90 help, 99 deleting; the canvas has room from 70 on.
import * as Blockly from 'blockly/core';
import {canPause, pausesHere, togglePause} from './breakpoints';
import {type Clipboard} from './clipboard';
import {focusedBlock} from './help';
import {canFold, fold} from './folding';
import {CHOOSE_ALL_SHORTCUT, chooseAll, registerChooseAll} from './frame';
import {iconElement} from './icons';
import {ctrl, keyWords} from './keys';
import {hiddenIn, leadTo} from './inside_marks';
import {addCanvasNote, addNote, hasNote, removeNote} from './notes';
import {registerRemoveMenu} from './remove_menu';
import {allChosenWith, chosenWith, countIn, notesChosenWith, removeChosenWith} from './selection';
import {t} from './words';

const {names} = Blockly.ShortcutItems;
const {ScopeType} = Blockly.ContextMenuRegistry;
const OFF = 'MANUALLY_DISABLED';
const SWITCH = 'nepSwitch';

const REMOVED = ['collapseWorkspace', 'expandWorkspace', 'blockInline', 'blockHelp', 'commentCreate', 'commentDelete',
  'commentDuplicate', 'blockDuplicate', 'blockCollapseExpand', 'blockDisable', 'blockDelete', 'blockComment'];

/** Blockly's own entries that stay: their weight here, and their icon. */
const KEPT: Readonly<Record<string, [weight: number, icon: string]>> = {
  undoWorkspace: [20, 'undo-2'],
  redoWorkspace: [21, 'redo-2'],
  cleanWorkspace: [40, 'list-checks'],
  workspaceDelete: [99, 'trash-2'],
};

const icons = new Map<string, string>();

/** The icon of an entry, by the entry's id. */
export function menuIcon(id: string, icon: string): void {
  icons.set(id, icon);
}

/** Before anything is made. */
export function trimMenu(): void {
  registerRemoveMenu();
  const registry = Blockly.ContextMenuRegistry.registry;
  for (const id of REMOVED) if (registry.getItem(id)) registry.unregister(id);
  for (const [id, [weight, icon]] of Object.entries(KEPT)) {
    const item = registry.getItem(id);
    if (item) item.weight = weight;
    menuIcon(id, icon);
  }
  menuIcon('nepHelp', 'circle-question-mark');
  menuIcon('nepRemoveItem', 'list-minus');
  menuIcon('nepAddElseIf', 'split');
  menuIcon('nepAddElse', 'split');
  // Nothing asks: deleting can be undone.
  Blockly.dialog.setConfirm((_message, callback) => callback(true));
}

type Scope = Blockly.ContextMenuRegistry.Scope;

interface Entry {
  id: string;
  weight: number;
  icon: string;
  words: string | ((scope: Scope) => string);
  /** The shortcut that does the same. */
  shortcut?: string;
  when(scope: Scope): boolean | 'disabled';
  run(scope: Scope, place: {x: number; y: number}): unknown;
}

function add(scopeType: Blockly.ContextMenuRegistry.ScopeType, entry: Entry): void {
  const {id, weight, icon, words, shortcut} = entry;
  menuIcon(id, icon);
  Blockly.ContextMenuRegistry.registry.register({
    id, weight, scopeType,
    displayText: typeof words === 'string' ? words : (scope) => words(scope),
    ...(shortcut !== undefined && {associatedKeyboardShortcut: shortcut}),
    preconditionFn: (scope) => {
      const when = entry.when(scope);
      return when === 'disabled' ? when : when ? 'enabled' : 'hidden';
    },
    callback: (scope, _opened, _chosen, place) => void entry.run(scope, place),
  });
}

function line(scopeType: Blockly.ContextMenuRegistry.ScopeType, weight: number): void {
  Blockly.ContextMenuRegistry.registry.register({id: `nepLine${scopeType}${weight}`, weight, scopeType, separator: true});
}

/** Whether a person may change the block of this menu. */
function own({block}: Scope): boolean {
  return block !== undefined && !block.isInFlyout && !block.isShadow();
}

export function registerMenu(clipboard: Clipboard): void {
  const block = (entry: Entry) => add(ScopeType.BLOCK, entry);
  block({id: 'nepDuplicate', weight: 10, icon: 'copy-plus', words: t('Duplicate'), shortcut: names.DUPLICATE,
    when: own, run: (it) => clipboard.duplicate(it.block)});
  block({id: 'nepCopy', weight: 11, icon: 'copy', words: t('Copy'), shortcut: names.COPY,
    when: ({block: it}) => it !== undefined, run: (it) => clipboard.copy(it.block)});
  block({id: 'nepCut', weight: 12, icon: 'scissors', words: t('Cut'), shortcut: names.CUT,
    when: (it) => own(it) && it.block!.isDeletable(), run: (it) => clipboard.cut(it.block)});
  block({id: 'nepPaste', weight: 13, icon: 'clipboard-paste', words: t('Paste'), shortcut: names.PASTE,
    when: own, run: (_it, place) => clipboard.paste(place)});
  line(ScopeType.BLOCK, 50);
  block({id: 'nepCollapse', weight: 51, icon: 'fold-vertical', words: t('Collapse'),
    when: (it) => own(it) && all(it.block!).some((each) => !each.isCollapsed() && canFold(each)),
    run: (it) => step(() => all(it.block!).filter(canFold).forEach((each) => fold(each, true)))});
  block({id: 'nepExpand', weight: 52, icon: 'unfold-vertical', words: t('Expand'),
    when: (it) => own(it) && all(it.block!).some((each) => each.isCollapsed()),
    run: (it) => step(() => all(it.block!).forEach((each) => fold(each, false)))});
  block({id: 'nepOff', weight: 53, icon: 'power-off', words: t('Disable block'), shortcut: SWITCH,
    when: (it) => own(it) && all(it.block!).some((each) => !each.hasDisabledReason(OFF) && !each.getInheritedDisabled()),
    run: (it) => switchOff(it.block!, true)});
  block({id: 'nepOn', weight: 54, icon: 'power', words: t('Enable block'), shortcut: SWITCH,
    when: (it) => own(it) && all(it.block!).some((each) => each.hasDisabledReason(OFF)), run: (it) => switchOff(it.block!, false)});
  block({id: 'nepNote', weight: 70, icon: 'sticky-note', words: t('Add a note'),
    when: (it) => own(it) && !hasNote(it.block!) && !it.block!.isCollapsed(), run: (it) => addNote(it.block!)});
  block({id: 'nepNoNote', weight: 70, icon: 'sticky-note', words: t('Remove the note'),
    when: (it) => own(it) && hasNote(it.block!), run: (it) => removeNote(it.block!)});
  block({id: 'nepPause', weight: 75, icon: 'circle-pause',
    words: (it) => it.block && pausesHere(it.block) ? t('Don\'t pause here') : t('Pause here'),
    when: (it) => own(it) && canPause(it.block!), run: (it) => togglePause(it.block!)});
  block({id: 'nepShowNote', weight: 71, icon: 'sticky-note', words: t('Show the note inside this block'),
    when: (it) => own(it) && hiddenIn(it.block!, 'note') !== null, run: (it) => leadTo(hiddenIn(it.block!, 'note')!)});
  block({id: 'nepShowPause', weight: 76, icon: 'circle-pause', words: t('Show where the program pauses inside'),
    when: (it) => own(it) && hiddenIn(it.block!, 'pause') !== null, run: (it) => leadTo(hiddenIn(it.block!, 'pause')!)});
  line(ScopeType.BLOCK, 80);
  line(ScopeType.BLOCK, 98);
  block({id: 'nepDelete', weight: 99, icon: 'trash-2', shortcut: names.DELETE,
    words: (it) => it.block ? deleteWords(it.block) : '',
    when: (it) => own(it) && it.block!.isDeletable(), run: (it) => remove(it.block!)});

  Blockly.ShortcutRegistry.registry.register({
    name: SWITCH, keyCodes: [ctrl(Blockly.utils.KeyCodes.E)], displayText: () => t('Disable or enable the block'),
    preconditionFn: (workspace) => !workspace.isDragging() && !workspace.isFlyout,
    callback: () => {
      const it = focusedBlock();
      if (!it || it.isInFlyout || it.getInheritedDisabled()) return false;
      switchOff(it, !it.hasDisabledReason(OFF));
      return true;
    },
  });

  registerChooseAll();
  add(ScopeType.WORKSPACE, {id: 'nepChooseAll', weight: 12, icon: 'square-dashed-mouse-pointer', words: t('Select all'),
    shortcut: CHOOSE_ALL_SHORTCUT,
    when: ({workspace}) => (workspace ? workspace.getTopBlocks(false).length + workspace.getTopComments().length : 0) > 0,
    run: ({workspace}) => workspace && chooseAll(workspace)});
  add(ScopeType.WORKSPACE, {id: 'nepPasteHere', weight: 10, icon: 'clipboard-paste', words: t('Paste'),
    shortcut: names.PASTE, when: () => true, run: (_it, place) => clipboard.paste(place)});
  line(ScopeType.WORKSPACE, 15);
  line(ScopeType.WORKSPACE, 35);
  add(ScopeType.WORKSPACE, {id: 'nepNoteHere', weight: 50, icon: 'sticky-note', words: t('Add a note here'),
    when: () => true, run: (it, place) => it.workspace && addCanvasNote(it.workspace, place)});
  line(ScopeType.WORKSPACE, 98);

  const note = (entry: Entry) => add(ScopeType.COMMENT, entry);
  note({id: 'nepNoteDuplicate', weight: 10, icon: 'copy-plus', words: t('Duplicate'), shortcut: names.DUPLICATE,
    when: () => true, run: (it) => clipboard.duplicate(it.comment)});
  note({id: 'nepNoteCopy', weight: 11, icon: 'copy', words: t('Copy'), shortcut: names.COPY,
    when: () => true, run: (it) => clipboard.copy(it.comment)});
  note({id: 'nepNoteDelete', weight: 99, icon: 'trash-2', shortcut: names.DELETE,
    words: (it) => allChosenWith(it.comment).length ? t('Delete the selection') : t('Remove the note'),
    when: () => true, run: (it) => it.comment && !removeChosenWith(it.comment) && step(() => it.comment!.dispose())});
}

/** The shortcut that puts blocks into the backpack. */
export const PACK = 'nepPack';

/** What the menus need of the backpack. */
interface BackpackMenu {
  may(block: Blockly.BlockSvg | undefined): boolean;
  pack(block: Blockly.BlockSvg): void;
  isPacked(block: Blockly.BlockSvg): boolean;
  remove(block: Blockly.BlockSvg): void;
  count(): number;
  open(): void;
  empty(): void;
}

export function addToMenus(backpack: BackpackMenu): void {
  add(ScopeType.BLOCK, {id: 'nepPack', weight: 14, icon: 'backpack', words: t('Add to backpack'), shortcut: PACK,
    when: ({block}) => backpack.may(block), run: ({block}) => block && backpack.pack(block)});
  add(ScopeType.BLOCK, {id: 'nepUnpack', weight: 99, icon: 'trash-2', words: t('Remove from backpack'),
    shortcut: names.DELETE, when: ({block}) => block !== undefined && backpack.isPacked(block),
    run: ({block}) => block && backpack.remove(block)});
  add(ScopeType.WORKSPACE, {id: 'nepOpenBackpack', weight: 13, icon: 'backpack',
    words: () => t('Open the backpack ({count})', {count: backpack.count()}),
    when: () => backpack.count() > 0, run: () => backpack.open()});
  add(ScopeType.WORKSPACE, {id: 'nepEmptyBackpack', weight: 14, icon: 'trash-2', words: t('Empty the backpack'),
    when: () => backpack.count() > 0, run: () => backpack.empty()});
}

export function registerPictureMenu(command: (name: string) => void): void {
  const canvas = (entry: Omit<Entry, 'when'>) => add(ScopeType.WORKSPACE,
    {...entry, when: ({workspace}) => (workspace?.getTopBlocks(false).length ?? 0) > 0});
  line(ScopeType.WORKSPACE, 60);
  canvas({id: 'nepPicture', weight: 61, icon: 'image-down', words: t('Save as image'), run: () => command('picture.save')});
  canvas({id: 'nepCopyPicture', weight: 62, icon: 'image', words: t('Copy as image'), run: () => command('picture.copy')});
  canvas({id: 'nepPrintBlocks', weight: 63, icon: 'printer', words: t('Print'), run: () => command('print.ask')});
}

// ---- how a block is

/** A block that is off is skipped; with the block that starts a script, all of the script. */
export function switchOff(block: Blockly.BlockSvg, off: boolean): void {
  const chosen = chosenWith(block);
  step(() => {
    for (const each of chosen) each.setDisabledReason(off, OFF);
    if (chosen.length) return;
    const starts = !block.previousConnection && !block.outputConnection;
    for (let each: Blockly.BlockSvg | null = block; each; each = starts ? each.getNextBlock() : null) {
      each.setDisabledReason(off, OFF);
    }
  });
}

function step(change: () => void): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  change();
  Blockly.Events.setGroup(group);
}

function deleteWords(block: Blockly.BlockSvg): string {
  if (notesChosenWith(block).length) return t('Delete the selection');
  const count = countIn(all(block));
  return count === 1 ? Blockly.Msg['DELETE_BLOCK'] ?? '' :
    (Blockly.Msg['DELETE_X_BLOCKS'] ?? '').replace('%1', String(count));
}

/** The block of a menu, or all that are chosen with it. */
function all(block: Blockly.BlockSvg): Blockly.BlockSvg[] {
  const chosen = chosenWith(block);
  return chosen.length ? chosen : [block];
}

/** Where several blocks are chosen, only what is done to all of them. */
const FOR_SEVERAL = new Set(['nepDuplicate', 'nepCopy', 'nepCut', 'nepPaste', 'nepCollapse', 'nepExpand', 'nepOff', 'nepOn', 'nepDelete', 'nepPack']);

/** Who adds an entry that is done to all chosen blocks says so. */
export function forSeveral(id: string): void {
  FOR_SEVERAL.add(id);
}

function remove(block: Blockly.BlockSvg): void {
  Blockly.getFocusManager().focusNode(block);
  block.checkAndDelete();
}

// ---- how a row looks

function row(icon: string, words: string, keys: string): HTMLElement {
  const made = document.createElement('div');
  made.className = 'nepMenuRow';
  const label = document.createElement('span');
  label.textContent = words;
  const picture = document.createElement('i');
  if (icon) picture.append(iconElement(icon, 18, 1.75));
  made.append(picture, label);
  if (keys) {
    const hint = document.createElement('kbd');
    hint.textContent = keys;
    made.append(hint);
  }
  return made;
}

type Option = Blockly.ContextMenuRegistry.ContextMenuOption;

/** No line at an end, and one where all between two is hidden. */
function withoutSpareLines(options: Option[]): Option[] {
  const first = options.findIndex((each) => !each.separator);
  const ends = (at: number) => at + 1 === options.length || options[at + 1]?.separator === true;
  return options.filter((each, at) => !each.separator || (at > first && !ends(at)));
}

const registryOf = Blockly.ContextMenuRegistry.prototype;
const optionsOf = registryOf.getContextMenuOptions;
registryOf.getContextMenuOptions = function (scope, event) {
  const several = allChosenWith(scope.block as Blockly.BlockSvg | undefined).length > 0;
  const options = optionsOf.call(this, scope, event).filter((each) => each.separator || !several || FOR_SEVERAL.has(each.id));
  for (const each of options) {
    if (each.separator || typeof each.text !== 'string') continue;
    const {associatedKeyboardShortcut: shortcut} = each;
    each.text = row(icons.get(each.id) ?? '', each.text, shortcut ? keyWords(shortcut) : '');
  }
  return withoutSpareLines(options);
};
