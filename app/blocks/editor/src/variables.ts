// The variables of a behaviour: the toolbox offers each of them, and follows when people make, rename or delete one.
import * as Blockly from 'blockly/core';
import {Toolbox} from './toolbox';
import type {Variable} from './variable_edits';

export const VARIABLES = 'variables';
const LISTS = 'lists';
const MAKES_LIST = 'lists_create';
const GETS = 'variables_get';
const SETS = 'variables_set';

const TOLD: ReadonlySet<string> = new Set([Blockly.Events.VAR_CREATE, Blockly.Events.VAR_RENAME,
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
    workspace.registerToolboxCategoryCallback(VARIABLES, () => this.offered());
    workspace.registerToolboxCategoryCallback(LISTS, () => this.offeredAboutList());
    workspace.addChangeListener((event) => TOLD.has(event.type) && this.refreshSoon());
  }

  /** Once for all the variables of a program that is being loaded. */
  private refreshSoon(): void {
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
  private list(): Variable | null {
    const variables = this.workspace.getVariableMap();
    const made = variables.getVariableById(this.newestList);
    if (made) return made;
    const set = this.workspace.getAllBlocks(false).filter((block) => block.type === SETS &&
      block.getInputTargetBlock('VALUE')?.type.startsWith('lists_'));
    return set[set.length - 1]?.getVarModels()[0] as Variable | undefined ?? null;
  }

  /** First what makes the list, then all that is done with it. */
  private offeredAboutList(): Blockly.utils.toolbox.FlyoutItemInfoArray {
    const toolbox = this.workspace.getToolbox();
    const given = (toolbox instanceof Toolbox ? toolbox.contentsOf(LISTS) : []) as Entry[];
    const list = this.list();
    if (!list) return given as Blockly.utils.toolbox.FlyoutItemInfoArray;
    const VAR = {id: list.getId()};
    const makes = given.find((entry) => entry.type === MAKES_LIST);
    const sets = {kind: 'block', type: SETS, fields: {VAR}, inputs: {VALUE: {block: {...makes, kind: undefined}}}};
    const about = (entry: Entry): Entry => {
      const filled = {...entry, ...(entry.fields?.['VAR'] !== undefined && {fields: {...entry.fields, VAR}})};
      const inputs = Object.entries(entry.inputs ?? {}).map(([name, {block, shadow}]) =>
        [name, {...(block && {block: about(block)}), ...(shadow && {shadow: about(shadow)})}]);
      return entry.inputs ? {...filled, inputs: Object.fromEntries(inputs)} : filled;
    };
    const above = given.findIndex((entry) => entry.type);
    return [...given.slice(0, above), sets, ...given.slice(above).map(about)] as unknown as
      Blockly.utils.toolbox.FlyoutItemInfoArray;
  }

  /** The blocks of the category about the newest variable, and the value of each. */
  private offered(): Blockly.utils.toolbox.FlyoutItemInfoArray {
    const toolbox = this.workspace.getToolbox();
    const given = (toolbox instanceof Toolbox ? toolbox.contentsOf(VARIABLES) : []) as Entry[];
    const all = this.workspace.getVariableMap().getVariablesOfType('');
    const newest = all[all.length - 1];
    if (!newest) return given as Blockly.utils.toolbox.FlyoutItemInfoArray;
    const about = (entry: Entry, variable: Blockly.IVariableModel<Blockly.IVariableState>) =>
      ({...entry, fields: {...entry.fields, VAR: {id: variable.getId()}}});
    const sorted = [...all].sort((one, other) => one.getName().localeCompare(other.getName()));
    return given.flatMap((entry) => {
      if (entry.type === GETS) return sorted.map((variable) => about(entry, variable));
      return entry.type ? [about(entry, newest)] : [entry];
    }) as unknown as Blockly.utils.toolbox.FlyoutItemInfoArray;
  }
}
