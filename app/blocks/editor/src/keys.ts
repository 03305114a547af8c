// The keys of the page. Blockly gives bare letters to many of its commands (D duplicates, C tidies): whoever types
// into nothing would change the program, so that each has Ctrl, Shift or Alt beside it here, or no key.
// `app/ui/shell/actions/shortcuts.py` lists them for people.
import * as Blockly from 'blockly/core';
import type {Clipboard} from './clipboard';
import {deleteByKey} from './selection';
import {lazy, t} from './words';

const {names} = Blockly.ShortcutItems;
const {KeyCodes} = Blockly.utils;
type Shortcut = Blockly.ShortcutRegistry.KeyboardShortcut;
type Keys = NonNullable<Shortcut['keyCodes']>;

const registry = Blockly.ShortcutRegistry.registry;

/** Ctrl, on a Mac Cmd, with a key. */
export function ctrl(key: number, ...more: number[]): string {
  return registry.createSerializedKey(key, [KeyCodes.CTRL_CMD, ...more]);
}

function alt(key: number, ...more: number[]): string {
  return registry.createSerializedKey(key, [KeyCodes.ALT, ...more]);
}

const KEYS: Readonly<Record<string, Keys>> = {
  [names.START_MOVE]: [ctrl(KeyCodes.M)],
  [names.START_MOVE_STACK]: [ctrl(KeyCodes.M, KeyCodes.SHIFT)],
  [names.DISCONNECT]: [ctrl(KeyCodes.X, KeyCodes.SHIFT)],
  [names.DUPLICATE]: [ctrl(KeyCodes.D)],
  [names.CLEANUP]: [ctrl(KeyCodes.L)],
  [names.FOCUS_TOOLBOX]: [ctrl(KeyCodes.B)],
  [names.FOCUS_WORKSPACE]: [ctrl(KeyCodes.B, KeyCodes.SHIFT)],
  [names.NEXT_STACK]: [alt(KeyCodes.DOWN)],
  [names.PREVIOUS_STACK]: [alt(KeyCodes.UP)],
  // In the toolbox, where these are asked before the two above.
  [names.NEXT_HEADING]: [alt(KeyCodes.DOWN)],
  [names.PREVIOUS_HEADING]: [alt(KeyCodes.UP)],
  // Ctrl+Enter runs from the block that has the keyboard (`tries.ts`).
  [names.MENU]: [registry.createSerializedKey(KeyCodes.F10, [KeyCodes.SHIFT]), KeyCodes.CONTEXT_MENU],
  [names.INFORMATION]: [alt(KeyCodes.I)],
  [names.EXTENDED_INFORMATION]: [alt(KeyCodes.I, KeyCodes.SHIFT)],
};

/** Whether a person presses it while typing: a letter or a digit, alone or with Shift. */
function isTyped(key: string): boolean {
  const code = Number(key.replace(/^Shift\+/, ''));
  return (code >= KeyCodes.ZERO && code <= KeyCodes.NINE) || (code >= KeyCodes.A && code <= KeyCodes.Z);
}

function give(name: string, keyCodes: Keys, changes: Partial<Shortcut> = {}): void {
  const shortcut = registry.getRegistry()[name];
  if (!shortcut) throw new Error(`Blockly has no shortcut ${name}`);
  registry.unregister(name);
  registry.register({...shortcut, ...changes, keyCodes, allowCollision: true}, true);
}

/** Takes the one block out of its stack, which closes behind it; Blockly takes all below along when Shift is held. */
function takeOut(): boolean {
  const block = Blockly.getFocusManager().getFocusedNode();
  if (!(block instanceof Blockly.BlockSvg)) return false;
  Blockly.keyboardNavigationController.setIsActive(true);
  Blockly.Events.setGroup(true);
  block.unplug(true);
  Blockly.Events.setGroup(false);
  return true;
}

const NAMES: Readonly<Record<number, string>> = {
  [KeyCodes.DELETE]: lazy('Del'), [KeyCodes.ENTER]: '↵', [KeyCodes.UP]: '↑', [KeyCodes.DOWN]: '↓', [KeyCodes.SLASH]: '/',
};

/** The first key of a command as menus show it: Ctrl+D, on a Mac ⌘D. */
export function keyWords(name: string): string {
  const [key] = registry.getKeyCodesByShortcutName(name);
  if (!key) return '';
  const parts = key.split('+');
  const code = Number(parts.pop());
  const last = NAMES[code];
  const isMac = parts.includes('Meta');
  const words = isMac ? [['Control', '⌃'], ['Alt', '⌥'], ['Shift', '⇧'], ['Meta', '⌘']] as const :
    [['Control', t('Ctrl')], ['Alt', t('Alt')], ['Shift', t('Shift')]] as const;
  const held = words.filter(([each]) => parts.includes(each)).map(([, word]) => word);
  return [...held, last ? t(last) : String.fromCharCode(code)].join(isMac ? '' : '+');
}

/** Copy, cut, paste and duplicate as our clipboard does them. */
export function useClipboard(clipboard: Clipboard): void {
  const may = (workspace: Blockly.WorkspaceSvg) =>
    !workspace.isDragging() && !Blockly.getFocusManager().ephemeralFocusTaken();
  const does = (name: string, run: () => unknown) => {
    const keyCodes = registry.getKeyCodesByShortcutName(name);
    give(name, keyCodes, {
      preconditionFn: may,
      callback: (_workspace, event) => {
        event.preventDefault();
        run();
        return true;
      },
    });
  };
  does(names.COPY, () => clipboard.copy());
  does(names.CUT, () => clipboard.cut());
  does(names.PASTE, () => void clipboard.paste());
  does(names.DUPLICATE, () => clipboard.duplicate());
}

/** Call it once, after everybody has registered their shortcuts. */
export function useOwnKeys(): void {
  for (const [name, keys] of Object.entries(KEYS)) {
    give(name, keys, name === names.DISCONNECT ? {callback: takeOut} : {});
  }
  const {callback} = registry.getRegistry()[names.DELETE]!;
  give(names.DELETE, registry.getKeyCodesByShortcutName(names.DELETE), {
    callback: (workspace, event, ...more) => {
      event.preventDefault();
      return deleteByKey() || (callback?.(workspace, event, ...more) ?? false);
    },
  });
  for (const [key, commands] of Object.entries(registry.getKeyMap())) {
    if (!isTyped(key)) continue;
    for (const name of commands) {
      console.warn(`${name} would be done by typing: it has no key`);
      registry.removeKeyMapping(key, name);
    }
  }
}
