// Creates, renames and deletes variables; the window shows the dialogs and sends the edits to the page.
import * as Blockly from 'blockly/core';
import {send} from './channel';
import type {VariableEdit} from './messages';
import {t} from './words';

export type Variable = Blockly.IVariableModel<Blockly.IVariableState>;

const NEW_VARIABLE_ID = 'NEP_NEW_VARIABLE';

/** Drop-down in which “New variable” was chosen; it is set to the created variable. */
let pendingField: Blockly.FieldVariable | null = null;

/** Runs a command of the window for variables. */
function runCommand(command: string): void {
  send({type: 'commandRequested', command});
}

export function registerVariableButtons(workspace: Blockly.WorkspaceSvg): void {
  const press = (command: string) => () => {
    pendingField = null;
    runCommand(command);
  };
  workspace.registerButtonCallback('CREATE_VARIABLE', press('variable.new'));
  workspace.registerButtonCallback('CREATE_LIST', press('variable.new_list'));
}

/** Applies an edit as one undo step; returns the variable, or null if there is none. */
export function editVariable(workspace: Blockly.WorkspaceSvg, edit: VariableEdit): Variable | null {
  const variables = workspace.getVariableMap();
  const variable = variables.getVariableById(edit.id);
  const group = Blockly.Events.getGroup();
  Blockly.Events.setGroup(true);
  try {
    if (edit.do === 'new' && edit.name) {
      const created = variables.createVariable(edit.name);
      if (pendingField && !pendingField.getSourceBlock()?.isDeadOrDying()) pendingField.setValue(created.getId());
      pendingField = null;
      return created;
    }
    if (edit.do === 'rename' && variable && edit.name) variables.renameVariable(variable, edit.name);
    else if (edit.do === 'delete' && variable) deleteWithUses(workspace, variable);
    return variable;
  } finally {
    Blockly.Events.setGroup(group);
  }
}

/** Deletes a variable and the blocks that use it; the blocks below them move up. */
function deleteWithUses(workspace: Blockly.WorkspaceSvg, variable: Variable): void {
  const id = variable.getId();
  for (const block of workspace.getAllBlocks(false)) {
    if (block.isDeadOrDying() || block.isShadow()) continue;
    if (block.getVarModels().some((model) => model.getId() === id)) block.dispose(true);
  }
  workspace.getVariableMap().deleteVariable(variable);
}

// ---- Drop-down of a variable

interface FieldVariableInternals {
  onItemSelected_(this: Blockly.FieldVariable, menu: Blockly.Menu, item: Blockly.MenuItem): void;
}

const baseOnItemSelected = (Blockly.FieldVariable.prototype as unknown as FieldVariableInternals).onItemSelected_;
(Blockly.FieldVariable.prototype as unknown as FieldVariableInternals).onItemSelected_ = function (menu, item) {
  const value = item.getValue();
  const id = this.getVariable()?.getId() ?? '';
  pendingField = null;
  if (value === NEW_VARIABLE_ID) {
    pendingField = this;
    runCommand('variable.new');
  } else if (value === Blockly.RENAME_VARIABLE_ID) {
    runCommand(`variable.rename:${id}`);
  } else if (value === Blockly.DELETE_VARIABLE_ID) {
    runCommand(`variable.delete:${id}`);
  } else {
    baseOnItemSelected.call(this, menu, item);
  }
};

const baseDropdownCreate = Blockly.FieldVariable.dropdownCreate;
Blockly.FieldVariable.dropdownCreate = function (this: Blockly.FieldVariable): Blockly.MenuOption[] {
  const inFlyout = this.getSourceBlock()?.isInFlyout;
  const isEditOption = (option: Blockly.MenuOption) => Array.isArray(option) &&
    (option[1] === Blockly.RENAME_VARIABLE_ID || option[1] === Blockly.DELETE_VARIABLE_ID);
  const all = baseDropdownCreate.call(this);
  // In the toolbox the drop-down offers only a choice, no edits.
  if (inFlyout) return all.filter((option) => !isEditOption(option));
  const editOptions = all.filter(isEditOption);
  const names = all.filter((option) => !isEditOption(option));
  return [...names, [t('New variable'), NEW_VARIABLE_ID], ...editOptions];
};

// ---- Context menu of a block with a variable

function variableOf(block?: Blockly.BlockSvg): Variable | null {
  const [only, other] = block?.getVarModels() ?? [];
  return only && !other ? only as Variable : null;
}

export function registerVariableMenu(isWatched: (id: string) => boolean): void {
  const scopeType = Blockly.ContextMenuRegistry.ScopeType.BLOCK;
  const entry = (id: string, weight: number, getLabel: (variable: Variable) => string, command: string) =>
    Blockly.ContextMenuRegistry.registry.register({
      id, weight, scopeType,
      displayText: ({block}) => {
        const variable = variableOf(block);
        return variable ? getLabel(variable) : '';
      },
      preconditionFn: ({block}) => {
        const variable = variableOf(block);
        const real = variable && block?.workspace.getVariableMap().getVariableById(variable.getId());
        return real ? 'enabled' : 'hidden';
      },
      callback: ({block}) => {
        const variable = variableOf(block);
        if (variable) runCommand(`${command}:${variable.getId()}`);
      },
    });
  entry('nepWatch', 6.1, (variable) => isWatched(variable.getId()) ?
    t('Hide the value of “{name}”', {name: variable.getName()}) :
    t('Show the value of “{name}”', {name: variable.getName()}), 'variable.watch');
  entry('nepRenameVariable', 6.2, (variable) => t('Rename “{name}”', {name: variable.getName()}), 'variable.rename');
}
