// Fewer entries, plain words.
import * as Blockly from 'blockly/core';
import {offerRemoving} from './remove_menu';

const REMOVED = ['collapseWorkspace', 'expandWorkspace', 'blockInline', 'blockCollapseExpand', 'blockDisable',
  'blockHelp', 'commentCreate', 'commentDelete', 'commentDuplicate'];

const WORDS: Readonly<Record<string, string>> = {
  CLEAN_UP: 'Tidy up',
  DUPLICATE_BLOCK: 'Duplicate',
  ADD_COMMENT: 'Add a note',
  REMOVE_COMMENT: 'Remove the note',
  DELETE_BLOCK: 'Delete',
  DELETE_X_BLOCKS: 'Delete %1 blocks',
  DIALOG_OK: 'Use it',
  DIALOG_CANCEL: 'Not now',
  NEW_VARIABLE_TITLE: 'Name of the variable',
  UNDO: 'Undo',
  REDO: 'Redo',
};

export function trimMenu(language: string): void {
  offerRemoving();
  for (const id of REMOVED) {
    if (Blockly.ContextMenuRegistry.registry.getItem(id)) Blockly.ContextMenuRegistry.registry.unregister(id);
  }
  // Nothing asks: deleting can be undone.
  Blockly.dialog.setConfirm((_message, callback) => callback(true));
  if (language === 'en') Object.assign(Blockly.Msg, WORDS);
}
