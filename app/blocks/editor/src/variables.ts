// The variables of a behaviour: the toolbox offers each of them, and follows when people make, rename or delete one.
import * as Blockly from 'blockly/core';
import {Toolbox} from './toolbox';

export const VARIABLES = 'variables';
const GETS = 'variables_get';

const TOLD: ReadonlySet<string> = new Set([Blockly.Events.VAR_CREATE, Blockly.Events.VAR_RENAME,
  Blockly.Events.VAR_DELETE]);

interface Entry {
  type?: string;
  fields?: Record<string, unknown>;
}

export class Variables {
  private waiting = false;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    workspace.registerToolboxCategoryCallback(VARIABLES, () => this.offered());
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
    if (toolbox instanceof Toolbox && this.workspace.rendered) toolbox.refreshDynamic(VARIABLES);
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
