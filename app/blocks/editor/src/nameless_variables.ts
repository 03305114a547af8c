// Variables that blocks of a file use without a name in the file. Blockly would generate names, which would
// then be saved; ours have a placeholder until the user names them.
import * as Blockly from 'blockly/core';
import {argsOf, definitionOf} from './definitions';
import type {BlockState} from './unknown_blocks';
import {t} from './words';

type Json = Record<string, unknown>;

export class NamelessVariables {
  /** Placeholder names by variable id. */
  private readonly placeholders = new Map<string, string>();

  constructor(private readonly workspace: Blockly.Workspace) {}

  /** Creates the variables that these blocks need; call before the blocks are created. */
  create(tops: readonly BlockState[]): void {
    this.placeholders.clear();
    const variables = this.workspace.getVariableMap();
    const waiting = tops.filter(isState);
    for (let state = waiting.pop(); state; state = waiting.pop()) {
      for (const id of unnamedVariableIds(state)) {
        if (variables.getVariableById(id)) continue;
        const name = this.freeName(t('unnamed variable'));
        this.placeholders.set(id, name);
        variables.createVariable(name, '', id);
      }
      for (const connectionState of [...Object.values(state.inputs ?? {}), state.next]) {
        waiting.push(...[connectionState?.block, connectionState?.shadow].filter(isState));
      }
    }
  }

  private freeName(words: string): string {
    const usedNames = this.workspace.getVariableMap().getAllVariables().map((variable) => variable.getName());
    let name = words;
    for (let number = 2; usedNames.includes(name); number++) name = `${words} ${number}`;
    return name;
  }

  /** Returns the state to save, without variables that still have a placeholder name. */
  omitPlaceholders(state: Json): Json {
    const {variables, ...others} = state;
    if (!this.placeholders.size || !Array.isArray(variables)) return state;
    const namedVariables = (variables as Blockly.IVariableState[]).filter(({id, name}) => this.placeholders.get(id ?? '') !== name);
    return namedVariables.length ? {...others, variables: namedVariables} : others;
  }
}

/** Returns the variable ids in the fields of a block state that have no name. */
function unnamedVariableIds(state: BlockState): string[] {
  const definition = definitionOf(state.type);
  const names = definition ? argsOf(definition).filter((arg) => arg.type === 'field_variable').map((arg) => arg.name ?? '') : [];
  return names.flatMap((name) => {
    const {id, name: savedName} = (state.fields?.[name] ?? {}) as {id?: unknown; name?: unknown};
    return typeof id === 'string' && id && typeof savedName !== 'string' ? [id] : [];
  });
}

function isState(value: unknown): value is BlockState {
  return typeof value === 'object' && value !== null;
}
