// The variables of a behaviour: the toolbox offers each of them, and follows when people make, rename or delete one.
import * as Blockly from 'blockly/core';
import {Toolbox} from './toolbox';
import type {Variable} from './variable_edits';

export const VARIABLES = 'variables';
const LISTS = 'lists';
const CREATE_LIST_TYPE = 'lists_create';
const GETTER_TYPE = 'variables_get';
const SETTER_TYPE = 'variables_set';

const VARIABLE_EVENTS: ReadonlySet<string> = new Set([Blockly.Events.VAR_CREATE, Blockly.Events.VAR_RENAME,
  Blockly.Events.VAR_DELETE]);

interface Entry {
  type?: string;
  fields?: Record<string, unknown>;
  inputs?: Record<string, {block?: Entry; shadow?: Entry}>;
}

export class Variables {
  private waiting = false;
  private newestList = '';

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    workspace.registerToolboxCategoryCallback(VARIABLES, () => this.getVariableContents());
    workspace.registerToolboxCategoryCallback(LISTS, () => this.getListContents());
    workspace.addChangeListener((event) => VARIABLE_EVENTS.has(event.type) && this.scheduleRefresh());
  }

  /** Once for all the variables of a program that is being loaded. */
  private scheduleRefresh(): void {
    if (this.waiting) return;
    this.waiting = true;
    queueMicrotask(() => {
      this.waiting = false;
      this.refresh();
    });
  }

  /** Another program is here. */
  refresh(): void {
    const toolbox = this.workspace.getToolbox();
    if (!(toolbox instanceof Toolbox) || !this.workspace.rendered) return;
    toolbox.refreshDynamic(VARIABLES);
    toolbox.refreshDynamic(LISTS);
  }

  /** The blocks of the category of lists are about this variable from now on. */
  useAsList(variable: Variable): void {
    this.newestList = variable.getId();
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox) toolbox.openDynamic(LISTS);
  }

  /** The variable that a person made as a list last, else the last one that a block makes a list of. */
  private getList(): Variable | null {
    const variables = this.workspace.getVariableMap();
    const newest = variables.getVariableById(this.newestList);
    if (newest) return newest;
    const set = this.workspace.getAllBlocks(false).filter((block) => block.type === SETTER_TYPE &&
      block.getInputTargetBlock('VALUE')?.type.startsWith('lists_'));
    return set[set.length - 1]?.getVarModels()[0] as Variable | undefined ?? null;
  }

  /** First what makes the list, then all that is done with it. */
  private getListContents(): Blockly.utils.toolbox.FlyoutItemInfoArray {
    const toolbox = this.workspace.getToolbox();
    const contents = (toolbox instanceof Toolbox ? toolbox.contentsOf(LISTS) : []) as Entry[];
    const list = this.getList();
    if (!list) return contents as Blockly.utils.toolbox.FlyoutItemInfoArray;
    const VAR = {id: list.getId()};
    const makes = contents.find((entry) => entry.type === CREATE_LIST_TYPE);
    const sets = {kind: 'block', type: SETTER_TYPE, fields: {VAR}, inputs: {VALUE: {block: {...makes, kind: undefined}}}};
    const about = (entry: Entry): Entry => {
      const filled = {...entry, ...(entry.fields?.['VAR'] !== undefined && {fields: {...entry.fields, VAR}})};
      const inputs = Object.entries(entry.inputs ?? {}).map(([name, {block, shadow}]) =>
        [name, {...(block && {block: about(block)}), ...(shadow && {shadow: about(shadow)})}]);
      return entry.inputs ? {...filled, inputs: Object.fromEntries(inputs)} : filled;
    };
    const above = contents.findIndex((entry) => entry.type);
    return [...contents.slice(0, above), sets, ...contents.slice(above).map(about)] as unknown as
      Blockly.utils.toolbox.FlyoutItemInfoArray;
  }

  /** The blocks of the category about the newest variable, and the value of each. */
  private getVariableContents(): Blockly.utils.toolbox.FlyoutItemInfoArray {
    const toolbox = this.workspace.getToolbox();
    const contents = (toolbox instanceof Toolbox ? toolbox.contentsOf(VARIABLES) : []) as Entry[];
    const all = this.workspace.getVariableMap().getVariablesOfType('');
    const newest = all[all.length - 1];
    if (!newest) return contents as Blockly.utils.toolbox.FlyoutItemInfoArray;
    const about = (entry: Entry, variable: Blockly.IVariableModel<Blockly.IVariableState>) =>
      ({...entry, fields: {...entry.fields, VAR: {id: variable.getId()}}});
    const sorted = [...all].sort((variable, other) => variable.getName().localeCompare(other.getName()));
    return contents.flatMap((entry) => {
      if (entry.type === GETTER_TYPE) return sorted.map((variable) => about(entry, variable));
      return entry.type ? [about(entry, newest)] : [entry];
    }) as unknown as Blockly.utils.toolbox.FlyoutItemInfoArray;
  }
}
