// Maps the variables of blocks from another file to this behaviour's by name; missing ones are created.
import * as Blockly from 'blockly/core';
import type {BlockState, ConnectionState} from './unknown_blocks';

interface VariableRef {
  id: string;
  name: string;
  type?: string;
}

/** Returns `state` with variable ids of this behaviour; `newIds` collects ids of new names across several states. */
export function withLocalVariableIds(state: BlockState, workspace: Blockly.Workspace, newIds = new Map<string, string>()): BlockState {
  const variables = workspace.getVariableMap();
  const localId = ({id, name, type = ''}: VariableRef): string => {
    const existing = variables.getVariable(name, type);
    if (existing) return existing.getId();
    const key = `${type} ${name.toLowerCase()}`;
    // An id is taken if another variable here or another name of these states uses it.
    const isTaken = variables.getVariableById(id) !== null || [...newIds.values()].includes(id);
    const newId = newIds.get(key) ?? (isTaken ? Blockly.utils.idGenerator.genUid() : id);
    newIds.set(key, newId);
    return newId;
  };
  const field = (value: unknown) => isVariable(value) ? {...value, id: localId(value)} : value;
  const connected = (connectionState: ConnectionState): ConnectionState => ({...connectionState,
    ...(connectionState.block && {block: block(connectionState.block)}), ...(connectionState.shadow && {shadow: block(connectionState.shadow)})});
  const block = (blockState: BlockState): BlockState => ({...blockState,
    ...(blockState.fields && {fields: mapValues(blockState.fields, field)}),
    ...(blockState.inputs && {inputs: mapValues(blockState.inputs, connected)}), ...(blockState.next && {next: connected(blockState.next)})});
  return block(state);
}

function mapValues<V, W>(all: Record<string, V>, change: (value: V) => W): Record<string, W> {
  return Object.fromEntries(Object.entries(all).map(([name, value]) => [name, change(value)]));
}

function isVariable(value: unknown): value is VariableRef {
  const {id, name, type} = (value ?? {}) as Partial<VariableRef>;
  return typeof id === 'string' && typeof name === 'string' && (type === undefined || typeof type === 'string');
}
