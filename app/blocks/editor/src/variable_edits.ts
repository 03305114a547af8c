// New, renamed and deleted variables: the window asks for names, and tells the page what to do.
import * as Blockly from 'blockly/core';
import {t} from './words';

export type Variable = Blockly.IVariableModel<Blockly.IVariableState>;

/** What the window wants done with a variable. */
export interface VariableEdit {
  do: 'new' | 'rename' | 'delete' | 'watch';
  id?: string;
  name?: string;
  list?: boolean;
}

const NEW = 'NEP_NEW_VARIABLE';

/** Asks the window for a command by its name. */
let ask: (command: string) => void = () => undefined;
/** The drop-down in which a person chose “New variable”: it gets the one that is made. */
let asking: Blockly.FieldVariable | null = null;

/** Buttons and drop-downs about variables lead to the window's commands. */
export function askWindow(run: (command: string) => void): void {
  ask = run;
}

export function registerVariableButtons(workspace: Blockly.WorkspaceSvg): void {
  const press = (command: string) => () => {
    asking = null;
    ask(command);
  };
  workspace.registerButtonCallback('CREATE_VARIABLE', press('variable.new'));
  workspace.registerButtonCallback('CREATE_LIST', press('variable.new_list'));
}

/** Does it, as one step that undo takes back; the variable, if there is one. */
export function editVariable(workspace: Blockly.WorkspaceSvg, edit: VariableEdit): Variable | null {
  const variables = workspace.getVariableMap();
  const variable = edit.id === undefined ? null : variables.getVariableById(edit.id);
  const group = Blockly.Events.getGroup();
  Blockly.Events.setGroup(true);
  try {
    if (edit.do === 'new' && edit.name) {
      const made = variables.createVariable(edit.name);
      if (asking && !asking.getSourceBlock()?.isDeadOrDying()) asking.setValue(made.getId());
      asking = null;
      return made;
    }
    if (edit.do === 'rename' && variable && edit.name) variables.renameVariable(variable, edit.name);
    else if (edit.do === 'delete' && variable) deleteWithUses(workspace, variable);
    return variable;
  } finally {
    Blockly.Events.setGroup(group);
  }
}

/** What used a variable goes with it; what is below such a block moves up to its place. */
function deleteWithUses(workspace: Blockly.WorkspaceSvg, variable: Variable): void {
  const id = variable.getId();
  for (const block of workspace.getAllBlocks(false)) {
    if (block.isDeadOrDying() || block.isShadow()) continue;
    if (block.getVarModels().some((each) => each.getId() === id)) block.dispose(true);
  }
  workspace.getVariableMap().deleteVariable(variable);
}

// ---- the drop-down of a variable

interface Inside {
  onItemSelected_(this: Blockly.FieldVariable, menu: Blockly.Menu, item: Blockly.MenuItem): void;
}

const choose = (Blockly.FieldVariable.prototype as unknown as Inside).onItemSelected_;
(Blockly.FieldVariable.prototype as unknown as Inside).onItemSelected_ = function (menu, item) {
  const chosen = item.getValue();
  const id = this.getVariable()?.getId() ?? '';
  asking = null;
  if (chosen === NEW) {
    asking = this;
    ask('variable.new');
  } else if (chosen === Blockly.RENAME_VARIABLE_ID) {
    ask(`variable.rename:${id}`);
  } else if (chosen === Blockly.DELETE_VARIABLE_ID) {
    ask(`variable.delete:${id}`);
  } else {
    choose.call(this, menu, item);
  }
};

const offered = Blockly.FieldVariable.dropdownCreate;
Blockly.FieldVariable.dropdownCreate = function (this: Blockly.FieldVariable): Blockly.MenuOption[] {
  const inFlyout = this.getSourceBlock()?.isInFlyout;
  const isOwn = (option: Blockly.MenuOption) => Array.isArray(option) &&
    (option[1] === Blockly.RENAME_VARIABLE_ID || option[1] === Blockly.DELETE_VARIABLE_ID);
  const all = offered.call(this);
  // In the toolbox a drop-down only chooses.
  if (inFlyout) return all.filter((option) => !isOwn(option));
  const own = all.filter(isOwn);
  const names = all.filter((option) => !isOwn(option));
  return [...names, [t('New variable'), NEW], ...own];
};

// ---- the menu of a block with a variable

function variableOf(block?: Blockly.BlockSvg): Variable | null {
  const [only, other] = block?.getVarModels() ?? [];
  return only && !other ? only as Variable : null;
}

export function registerVariableMenu(isWatched: (id: string) => boolean): void {
  const scopeType = Blockly.ContextMenuRegistry.ScopeType.BLOCK;
  const entry = (id: string, weight: number, words: (variable: Variable) => string, command: string) =>
    Blockly.ContextMenuRegistry.registry.register({
      id, weight, scopeType,
      displayText: ({block}) => {
        const variable = variableOf(block);
        return variable ? words(variable) : '';
      },
      preconditionFn: ({block}) => {
        const variable = variableOf(block);
        const real = variable && block?.workspace.getVariableMap().getVariableById(variable.getId());
        return real ? 'enabled' : 'hidden';
      },
      callback: ({block}) => {
        const variable = variableOf(block);
        if (variable) ask(`${command}:${variable.getId()}`);
      },
    });
  entry('nepWatch', 6.1, (variable) => isWatched(variable.getId()) ?
    t('Hide the value of “{name}”', {name: variable.getName()}) :
    t('Show the value of “{name}”', {name: variable.getName()}), 'variable.watch');
  entry('nepRenameVariable', 6.2, (variable) => t('Rename “{name}”', {name: variable.getName()}), 'variable.rename');
}
