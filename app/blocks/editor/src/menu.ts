// Fewer entries, plain words.
import * as Blockly from 'blockly/core';
import {registerRemoveMenu} from './remove_menu';
import {lazy, t} from './words';

const REMOVED = ['collapseWorkspace', 'expandWorkspace', 'blockInline', 'blockCollapseExpand', 'blockDisable',
  'blockHelp', 'commentCreate', 'commentDelete', 'commentDuplicate'];

const WORDS: Readonly<Record<string, string>> = {
  CLEAN_UP: lazy('Tidy up'),
  DUPLICATE_BLOCK: lazy('Duplicate'),
  ADD_COMMENT: lazy('Add a note'),
  REMOVE_COMMENT: lazy('Remove the note'),
  DELETE_BLOCK: lazy('Delete'),
  DELETE_X_BLOCKS: lazy('Delete %1 blocks'),
  DIALOG_OK: lazy('Use it'),
  DIALOG_CANCEL: lazy('Not now'),
  NEW_VARIABLE_TITLE: lazy('Name of the variable'),
  UNDO: lazy('Undo'),
  REDO: lazy('Redo'),
};

export function trimMenu(language: string): void {
  registerRemoveMenu();
  for (const id of REMOVED) {
    if (Blockly.ContextMenuRegistry.registry.getItem(id)) Blockly.ContextMenuRegistry.registry.unregister(id);
  }
  // Nothing asks: deleting can be undone.
  Blockly.dialog.setConfirm((_message, callback) => callback(true));
  // Blockly's own words stay where nobody has translated ours.
  for (const [key, english] of Object.entries(WORDS)) {
    if (language === 'en' || t(english) !== english) Blockly.Msg[key] = t(english);
  }
}
