// Toolbox categories of variables and lists; they are refreshed when variables change.
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
  private isRefreshScheduled = false;
  private newestList = '';

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    workspace.registerToolboxCategoryCallback(VARIABLES, () => this.getVariableContents());
    workspace.registerToolboxCategoryCallback(LISTS, () => this.getListContents());
    workspace.addChangeListener((event) => VARIABLE_EVENTS.has(event.type) && this.scheduleRefresh());
  }

  /** Schedules one refresh for all variable events of a load. */
  private scheduleRefresh(): void {
    if (this.isRefreshScheduled) return;
    this.isRefreshScheduled = true;
    queueMicrotask(() => {
      this.isRefreshScheduled = false;
      this.refresh();
    });
  }

  /** Refreshes the variable and list categories. */
  refresh(): void {
    const toolbox = this.workspace.getToolbox();
    if (!(toolbox instanceof Toolbox) || !this.workspace.rendered) return;
    toolbox.refreshDynamic(VARIABLES);
    toolbox.refreshDynamic(LISTS);
  }

  /** Uses this variable in the blocks of the list category and opens the category. */
  useAsList(variable: Variable): void {
    this.newestList = variable.getId();
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox) toolbox.openDynamic(LISTS);
  }

  /** Returns the list created last, else the variable of the last block that assigns a list. */
  private getList(): Variable | null {
    const variables = this.workspace.getVariableMap();
    const newest = variables.getVariableById(this.newestList);
    if (newest) return newest;
    const setters = this.workspace.getAllBlocks(false).filter((block) => block.type === SETTER_TYPE &&
      block.getInputTargetBlock('VALUE')?.type.startsWith('lists_'));
    return setters[setters.length - 1]?.getVarModels()[0] as Variable | undefined ?? null;
  }

  /** Returns the list category: first the block that creates the list, then the blocks that use it. */
  private getListContents(): Blockly.utils.toolbox.FlyoutItemInfoArray {
    const toolbox = this.workspace.getToolbox();
    const contents = (toolbox instanceof Toolbox ? toolbox.contentsOf(LISTS) : []) as Entry[];
    const list = this.getList();
    if (!list) return contents as Blockly.utils.toolbox.FlyoutItemInfoArray;
    const VAR = {id: list.getId()};
    const createBlock = contents.find((entry) => entry.type === CREATE_LIST_TYPE);
    const setBlock = {kind: 'block', type: SETTER_TYPE, fields: {VAR}, inputs: {VALUE: {block: {...createBlock, kind: undefined}}}};
    const withVariable = (entry: Entry): Entry => {
      const filled = {...entry, ...(entry.fields?.['VAR'] !== undefined && {fields: {...entry.fields, VAR}})};
      const inputs = Object.entries(entry.inputs ?? {}).map(([name, {block, shadow}]) =>
        [name, {...(block && {block: withVariable(block)}), ...(shadow && {shadow: withVariable(shadow)})}]);
      return entry.inputs ? {...filled, inputs: Object.fromEntries(inputs)} : filled;
    };
    const firstBlockIndex = contents.findIndex((entry) => entry.type);
    return [...contents.slice(0, firstBlockIndex), setBlock, ...contents.slice(firstBlockIndex).map(withVariable)] as unknown as
      Blockly.utils.toolbox.FlyoutItemInfoArray;
  }

  /** Returns the variable category: blocks for the newest variable, and a getter for each variable. */
  private getVariableContents(): Blockly.utils.toolbox.FlyoutItemInfoArray {
    const toolbox = this.workspace.getToolbox();
    const contents = (toolbox instanceof Toolbox ? toolbox.contentsOf(VARIABLES) : []) as Entry[];
    const all = this.workspace.getVariableMap().getVariablesOfType('');
    const newest = all[all.length - 1];
    if (!newest) return contents as Blockly.utils.toolbox.FlyoutItemInfoArray;
    const withVariable = (entry: Entry, variable: Blockly.IVariableModel<Blockly.IVariableState>) =>
      ({...entry, fields: {...entry.fields, VAR: {id: variable.getId()}}});
    const sorted = [...all].sort((variable, other) => variable.getName().localeCompare(other.getName()));
    return contents.flatMap((entry) => {
      if (entry.type === GETTER_TYPE) return sorted.map((variable) => withVariable(entry, variable));
      return entry.type ? [withVariable(entry, newest)] : [entry];
    }) as unknown as Blockly.utils.toolbox.FlyoutItemInfoArray;
  }
}
