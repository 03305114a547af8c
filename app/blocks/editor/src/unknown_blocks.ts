// Placeholders for blocks of unknown types (an unknown robot, a newer Studio): shown grey, movable,
// and saved with their original state.
import * as Blockly from 'blockly/core';
import {type BlockDefinition, definitionOf, fieldNames, inputKinds} from './definitions';
import {readInputs} from './mutators';
import {t} from './words';

export const UNKNOWN_BLOCK = 'nep_kept';

export interface ConnectionState {
  block?: BlockState;
  shadow?: BlockState;
}

export interface BlockState {
  type: string;
  id?: string;
  x?: number;
  y?: number;
  fields?: Record<string, unknown>;
  inputs?: Record<string, ConnectionState>;
  next?: ConnectionState;
  extraState?: unknown;
  [other: string]: unknown;
}

type Shape = 'value' | 'statement' | 'hat';
type InputKind = 'value' | 'statement';

interface UnknownState {
  original: Record<string, unknown>;
  shape: Shape;
  inputs: [string, InputKind][];
  label: string;
  /** `original` includes the children, which could not be created either. */
  whole?: boolean;
}

function mapInputs(inputs: Record<string, ConnectionState>, change: (connection: ConnectionState, name: string) => ConnectionState) {
  return Object.fromEntries(Object.entries(inputs).map(([name, each]) => [name, change(each, name)]));
}

/** Returns `state` with every block that can't be created replaced by a placeholder. */
export function wrapUnknown(state: BlockState, shape: Shape | null = null): BlockState {
  const definition = definitionOf(state.type);
  const isKnown = definition !== null && matchesDefinition(state, definition, shape);
  const kinds = isKnown ? inputKinds(definition) : new Map<string, InputKind>();
  const kindOf = (name: string, connection: ConnectionState): InputKind => kinds.get(name) ?? guessInput(name, connection);
  const result: BlockState = {...state};
  if (state.inputs) {
    result.inputs = mapInputs(state.inputs, (connection, name) => wrapConnected(connection, kindOf(name, connection)));
  }
  if (state.next) result.next = wrapConnected(state.next, 'statement');
  if (isKnown) return result;
  const {id, x, y, inputs, next, ...original} = state;
  const form = shape ?? guessTop(state);
  const unknownState: UnknownState = {
    // A value block has no next connection, so the next block of the file stays in `original`.
    original: form === 'value' && next ? {...original, next} : original,
    shape: form,
    inputs: Object.entries(inputs ?? {}).map(([name, each]) => [name, kindOf(name, each)]),
    label: labelOf(state),
  };
  return {...position(id, x, y), type: UNKNOWN_BLOCK, extraState: unknownState,
    ...(result.inputs && {inputs: result.inputs}), ...(form !== 'value' && result.next && {next: result.next})};
}

/** Returns one placeholder for a whole stack: the fallback if the result of `wrapUnknown` can't be loaded. */
export function wrapWholeStack(state: BlockState): BlockState {
  const {id, x, y, ...original} = state;
  const unknownState: UnknownState = {original, shape: 'statement', inputs: [], label: labelOf(state), whole: true};
  return {...position(id, x, y), type: UNKNOWN_BLOCK, extraState: unknownState};
}

/** Reverts `wrapUnknown` and `wrapWholeStack`. */
export function unwrapUnknown(state: BlockState): BlockState {
  const {inputs, next, ...result} = state as BlockState;
  if (inputs) {
    const filled = Object.entries(inputs).map(([name, each]) => [name, unwrapConnected(each)] as const)
      .filter(([, each]) => each.block || each.shadow);
    if (filled.length) result['inputs'] = Object.fromEntries(filled);
  }
  if (next?.block || next?.shadow) result['next'] = unwrapConnected(next);
  if (state.type !== UNKNOWN_BLOCK) return result as BlockState;
  const unknownState = state.extraState as UnknownState;
  const {type, extraState, ...rest} = result;
  void type;
  void extraState;
  return {...unknownState.original, ...rest} as BlockState;
}

function position(id?: string, x?: number, y?: number): Record<string, unknown> {
  return {...(id !== undefined && {id}), ...(x !== undefined && {x}), ...(y !== undefined && {y})};
}

function wrapConnected(connection: ConnectionState, kind: InputKind): ConnectionState {
  return {...connection, ...(connection.block && {block: wrapUnknown(connection.block, kind)}),
    ...(connection.shadow && {shadow: wrapUnknown(connection.shadow, kind)})};
}

/** Unwraps the connected blocks; omits the `null` that Blockly saves for an insertion marker during a drag. */
function unwrapConnected(connection: ConnectionState): ConnectionState {
  return {...(connection.shadow && {shadow: unwrapUnknown(connection.shadow)}), ...(connection.block && {block: unwrapUnknown(connection.block)})};
}

/** Returns true if the definition has all connections, inputs and fields that the state uses. */
function matchesDefinition(state: BlockState, definition: BlockDefinition, shape: Shape | null): boolean {
  const connection = shape === 'value' ? 'output' : shape === 'statement' ? 'previousStatement' : null;
  if (connection && !(connection in definition)) return false;
  if (state.next && !('nextStatement' in definition)) return false;
  if (definition.mutator) return Object.keys(state.inputs ?? {}).every((name) => hasInput(state, definition, name));
  const inputs = inputKinds(definition);
  const fields = fieldNames(definition);
  return Object.keys(state.inputs ?? {}).every((name) => inputs.has(name)) &&
    Object.keys(state.fields ?? {}).every((name) => fields.has(name));
}

/** Returns true if a block with a mutator has this input according to its saved extra state. */
function hasInput(state: BlockState, definition: BlockDefinition, name: string): boolean {
  if (inputKinds(definition).has(name)) return true;
  const extra = (state.extraState ?? {}) as {items?: unknown; inputs?: unknown};
  if (definition.mutator === 'nep_call') return readInputs(extra.inputs).some((input) => name === `IN_${input.id}`);
  if (definition.mutator === 'nep_branches') {
    const {elseIfs, else: hasElse} = extra as {elseIfs?: unknown; else?: unknown};
    const branch = /^(?:CONDITION|BODY)([1-9]\d?)$/.exec(name)?.[1];
    return name === 'ELSE' ? hasElse === true : branch !== undefined && typeof elseIfs === 'number' && Number(branch) <= Math.min(20, elseIfs);
  }
  const number = /^ITEM(\d{1,3})$/.exec(name)?.[1];
  return definition.mutator === 'nep_items' && number !== undefined &&
    Number(number) < Math.min(50, typeof extra.items === 'number' ? extra.items : 3);
}

function guessInput(name: string, connection: ConnectionState): InputKind {
  const child = connection.block ?? connection.shadow;
  if (child?.type === UNKNOWN_BLOCK) return (child.extraState as UnknownState).shape === 'value' ? 'value' : 'statement';
  const definition = child ? definitionOf(child.type) : null;
  if (definition) return 'output' in definition ? 'value' : 'statement';
  return child?.next || /^(do|else|then|body|stack|substack)/i.test(name) ? 'statement' : 'value';
}

function guessTop(state: BlockState): Shape {
  if (/(^|_)when_/.test(state.type) || state.type.startsWith('events_')) return 'hat';
  return /_get_/.test(state.type) && !state.next ? 'value' : 'statement';
}

function labelOf(state: BlockState): string {
  const name = String(state.type ?? 'block').replace(/^robot_[^_]+_(do|get|when)_/, '').replace(/[_\s]+/g, ' ').trim();
  const values = Object.values(state.fields ?? {}).filter((value) => ['string', 'number'].includes(typeof value));
  return [name, ...values].join(' ').slice(0, 80);
}

interface UnknownBlock extends Blockly.Block {
  kept?: UnknownState;
}

/** Returns true if this block is a placeholder for an unknown one. */
export function isUnknown(block: Blockly.Block): boolean {
  return block.type === UNKNOWN_BLOCK;
}

Blockly.Blocks[UNKNOWN_BLOCK] = {
  init(this: UnknownBlock) {
    this.setStyle('kept');
    this.setInputsInline(true);
  },
  saveExtraState(this: UnknownBlock) {
    return this.kept ?? null;
  },
  loadExtraState(this: UnknownBlock, state: UnknownState) {
    this.kept = state;
    const title = this.appendDummyInput();
    const icon = Blockly.fieldRegistry.fromJson({type: 'field_icon', name: 'circle-dashed'});
    if (icon) title.appendField(icon);
    title.appendField(state.label);
    for (const [name, kind] of state.inputs) {
      if (kind === 'value') this.appendValueInput(name);
      else this.appendStatementInput(name);
    }
    if (state.shape === 'value') {
      this.setOutput(true);
    } else {
      if (state.shape === 'hat') this.setStyle('kept_hat');
      else this.setPreviousStatement(true);
      this.setNextStatement(true);
    }
    this.setTooltip(t('This file uses “{block}”, which this version of Studio doesn\'t know. It stays in the file and is skipped when the program runs.', {block: state.label}));
  },
};
