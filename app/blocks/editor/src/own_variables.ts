// Blocks that come from another file name their variables: the one here of that name is meant, else a new one is made.
import * as Blockly from 'blockly/core';
import type {BlockState, ConnectionState} from './unknown_blocks';

interface Named {
  id: string;
  name: string;
  type?: string;
}

/** `state` with the ids of this behaviour; `fresh` holds those of names that are not here, for several states. */
export function withOwnVariables(state: BlockState, workspace: Blockly.Workspace, fresh = new Map<string, string>()): BlockState {
  const variables = workspace.getVariableMap();
  const ownId = ({id, name, type = ''}: Named): string => {
    const there = variables.getVariable(name, type);
    if (there) return there.getId();
    const key = `${type} ${name.toLowerCase()}`;
    // An id that is another variable's here, or another name's among these states, is not this one's.
    const taken = variables.getVariableById(id) !== null || [...fresh.values()].includes(id);
    const found = fresh.get(key) ?? (taken ? Blockly.utils.idGenerator.genUid() : id);
    fresh.set(key, found);
    return found;
  };
  const field = (value: unknown) => isVariable(value) ? {...value, id: ownId(value)} : value;
  const connected = (each: ConnectionState): ConnectionState => ({...each,
    ...(each.block && {block: block(each.block)}), ...(each.shadow && {shadow: block(each.shadow)})});
  const block = (each: BlockState): BlockState => ({...each,
    ...(each.fields && {fields: mapped(each.fields, field)}),
    ...(each.inputs && {inputs: mapped(each.inputs, connected)}), ...(each.next && {next: connected(each.next)})});
  return block(state);
}

function mapped<V, W>(all: Record<string, V>, change: (value: V) => W): Record<string, W> {
  return Object.fromEntries(Object.entries(all).map(([name, value]) => [name, change(value)]));
}

function isVariable(value: unknown): value is Named {
  const {id, name, type} = (value ?? {}) as Partial<Named>;
  return typeof id === 'string' && typeof name === 'string' && (type === undefined || typeof type === 'string');
}
