// Keyboard shortcuts of the page. Blockly assigns bare letters to many commands (D duplicates, C cleans up), so
// that typing outside a text field would edit the blocks; here each shortcut has a modifier key, or is removed.
// `app/ui/shell/actions/shortcuts.py` lists the shortcuts for users.
import * as Blockly from 'blockly/core';
import type {Clipboard} from './clipboard';
import {deleteByKey} from './selection';
import {lazy, t} from './words';

const {names} = Blockly.ShortcutItems;
const {KeyCodes} = Blockly.utils;
type Shortcut = Blockly.ShortcutRegistry.KeyboardShortcut;
type Keys = NonNullable<Shortcut['keyCodes']>;

const registry = Blockly.ShortcutRegistry.registry;

/** Returns the key with Ctrl, or Cmd on a Mac. */
export function ctrl(key: number, ...more: number[]): string {
  return registry.createSerializedKey(key, [KeyCodes.CTRL_CMD, ...more]);
}

function alt(key: number, ...more: number[]): string {
  return registry.createSerializedKey(key, [KeyCodes.ALT, ...more]);
}

const SHORTCUT_KEYS: Readonly<Record<string, Keys>> = {
  [names.START_MOVE]: [ctrl(KeyCodes.M)],
  [names.START_MOVE_STACK]: [ctrl(KeyCodes.M, KeyCodes.SHIFT)],
  [names.DISCONNECT]: [ctrl(KeyCodes.X, KeyCodes.SHIFT)],
  [names.DUPLICATE]: [ctrl(KeyCodes.D)],
  [names.CLEANUP]: [ctrl(KeyCodes.L)],
  [names.FOCUS_TOOLBOX]: [ctrl(KeyCodes.B)],
  [names.FOCUS_WORKSPACE]: [ctrl(KeyCodes.B, KeyCodes.SHIFT)],
  [names.NEXT_STACK]: [alt(KeyCodes.DOWN)],
  [names.PREVIOUS_STACK]: [alt(KeyCodes.UP)],
  // For the toolbox, where Blockly checks these before the two above.
  [names.NEXT_HEADING]: [alt(KeyCodes.DOWN)],
  [names.PREVIOUS_HEADING]: [alt(KeyCodes.UP)],
  // Ctrl+Enter (`tries.ts`) runs from the focused block.
  [names.MENU]: [registry.createSerializedKey(KeyCodes.F10, [KeyCodes.SHIFT]), KeyCodes.CONTEXT_MENU],
  [names.INFORMATION]: [alt(KeyCodes.I)],
  [names.EXTENDED_INFORMATION]: [alt(KeyCodes.I, KeyCodes.SHIFT)],
};

/** Returns true for a key used for typing: a letter or a digit, alone or with Shift. */
function isTypingKey(key: string): boolean {
  const code = Number(key.replace(/^Shift\+/, ''));
  return (code >= KeyCodes.ZERO && code <= KeyCodes.NINE) || (code >= KeyCodes.A && code <= KeyCodes.Z);
}

function overrideShortcut(name: string, keyCodes: Keys, changes: Partial<Shortcut> = {}): void {
  const shortcut = registry.getRegistry()[name];
  if (!shortcut) throw new Error(`Blockly has no shortcut ${name}`);
  registry.unregister(name);
  registry.register({...shortcut, ...changes, keyCodes, allowCollision: true}, true);
}

/** Detaches only the focused block and closes its stack; with Shift, Blockly would detach the blocks below, too. */
function unplugFocusedBlock(): boolean {
  const block = Blockly.getFocusManager().getFocusedNode();
  if (!(block instanceof Blockly.BlockSvg)) return false;
  Blockly.keyboardNavigationController.setIsActive(true);
  Blockly.Events.setGroup(true);
  block.unplug(true);
  Blockly.Events.setGroup(false);
  return true;
}

const KEY_NAMES: Readonly<Record<number, string>> = {
  [KeyCodes.DELETE]: lazy('Del'), [KeyCodes.ENTER]: '↵', [KeyCodes.UP]: '↑', [KeyCodes.DOWN]: '↓', [KeyCodes.SLASH]: '/',
};

/** Returns a command's first shortcut as shown in menus: Ctrl+D, or ⌘D on a Mac. */
export function formatShortcut(name: string): string {
  const [key] = registry.getKeyCodesByShortcutName(name);
  if (!key) return '';
  const parts = key.split('+');
  const code = Number(parts.pop());
  const last = KEY_NAMES[code];
  const isMac = parts.includes('Meta');
  const modifierNames = isMac ? [['Control', '⌃'], ['Alt', '⌥'], ['Shift', '⇧'], ['Meta', '⌘']] as const :
    [['Control', t('Ctrl')], ['Alt', t('Alt')], ['Shift', t('Shift')]] as const;
  const modifiers = modifierNames.filter(([each]) => parts.includes(each)).map(([, word]) => word);
  return [...modifiers, last ? t(last) : String.fromCharCode(code)].join(isMac ? '' : '+');
}

/** Replaces Blockly's shortcuts for copy, cut, paste and duplicate with those of our clipboard. */
export function registerClipboardShortcuts(clipboard: Clipboard): void {
  const canRun = (workspace: Blockly.WorkspaceSvg) =>
    !workspace.isDragging() && !Blockly.getFocusManager().ephemeralFocusTaken();
  const setCallback = (name: string, run: () => unknown) => {
    const keyCodes = registry.getKeyCodesByShortcutName(name);
    overrideShortcut(name, keyCodes, {
      preconditionFn: canRun,
      callback: (_workspace, event) => {
        event.preventDefault();
        run();
        return true;
      },
    });
  };
  setCallback(names.COPY, () => clipboard.copy());
  setCallback(names.CUT, () => clipboard.cut());
  setCallback(names.PASTE, () => void clipboard.paste());
  setCallback(names.DUPLICATE, () => clipboard.duplicate());
}

/** Applies the shortcuts; call once, after all shortcuts have been registered. */
export function applyShortcutKeys(): void {
  for (const [name, keys] of Object.entries(SHORTCUT_KEYS)) {
    overrideShortcut(name, keys, name === names.DISCONNECT ? {callback: unplugFocusedBlock} : {});
  }
  const {callback} = registry.getRegistry()[names.DELETE]!;
  overrideShortcut(names.DELETE, registry.getKeyCodesByShortcutName(names.DELETE), {
    callback: (workspace, event, ...more) => {
      event.preventDefault();
      return deleteByKey() || (callback?.(workspace, event, ...more) ?? false);
    },
  });
  for (const [key, commands] of Object.entries(registry.getKeyMap())) {
    if (!isTypingKey(key)) continue;
    for (const name of commands) {
      console.warn(`Removed the key of ${name}, because it is used for typing`);
      registry.removeKeyMapping(key, name);
    }
  }
}
