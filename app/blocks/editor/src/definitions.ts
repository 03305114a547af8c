// Registers the window's block definitions and detects changes.
import * as Blockly from 'blockly/core';
import {type Option, isOption, setSource} from './choices';

export interface BlockArg {
  type: string;
  name?: string;
  source?: string;
  options?: unknown;
  [other: string]: unknown;
}

export interface BlockDefinition {
  type: string;
  mutator?: string;
  extensions?: string[];
  output?: unknown;
  previousStatement?: unknown;
  nextStatement?: unknown;
  [other: string]: unknown;
}

const definitionsByType = new Map<string, {definition: BlockDefinition; key: string}>();

/** Returns the types of blocks that show a live value. */
export function sensorTypes(): ReadonlySet<string> {
  return liveTypes;
}

const liveTypes = new Set<string>();

export function definitionOf(type: string): BlockDefinition | null {
  return definitionsByType.get(type)?.definition ?? null;
}

/** Returns the args of all message rows. */
export function argsOf(definition: BlockDefinition): BlockArg[] {
  const rows = Object.keys(definition).filter((name) => /^args\d+$/.test(name));
  return rows.flatMap((name) => definition[name] as BlockArg[]);
}

export function inputKinds(definition: BlockDefinition): Map<string, 'value' | 'statement'> {
  const result = new Map<string, 'value' | 'statement'>();
  for (const arg of argsOf(definition)) {
    if (arg.type === 'input_value') result.set(arg.name ?? '', 'value');
    if (arg.type === 'input_statement') result.set(arg.name ?? '', 'statement');
  }
  return result;
}

export function fieldNames(definition: BlockDefinition): Set<string> {
  const fields = argsOf(definition).filter((arg) => arg.type.startsWith('field_'));
  return new Set(fields.map((arg) => arg.name ?? ''));
}

/** Registers all definitions; returns the new or changed types, and whether the options of any source changed. */
export function defineBlocks(definitions: BlockDefinition[]): {changed: Set<string>; haveSourcesChanged: boolean} {
  const changed = new Set<string>();
  let haveSourcesChanged = false;
  for (const definition of definitions) {
    for (const arg of argsOf(definition)) {
      const source = sourceOf(arg);
      if (source && Array.isArray(arg.options)) {
        haveSourcesChanged = setSource(source, arg.options.filter(isOption)) || haveSourcesChanged;
      }
    }
    const key = keyOf(definition);
    if (definitionsByType.get(definition.type)?.key === key) continue;
    definitionsByType.set(definition.type, {definition, key});
    changed.add(definition.type);
    if (argsOf(definition).some((arg) => arg.type === 'field_live')) liveTypes.add(definition.type);
    register(withQuotes(definition));
  }
  return {changed, haveSourcesChanged};
}

/** Updates options alone, such as `{"topics": [["/faces", "/faces"], …]}`; returns true if any changed. */
export function defineSources(all: Record<string, Option[]>): boolean {
  return Object.entries(all).map(([name, options]) => setSource(name, options)).some(Boolean);
}

function sourceOf(arg: BlockArg): string {
  return arg.source ?? (arg.type === 'field_topic' && arg['of'] === undefined ? 'topics' : '');
}

/** Returns the definition as text, without the options that fields reread themselves. */
function keyOf(definition: BlockDefinition): string {
  return JSON.stringify(definition, function (this: unknown, name: string, value: unknown) {
    const owner = this as BlockArg;
    return name === 'options' && typeof owner.type === 'string' && sourceOf(owner) ? undefined : value;
  });
}

function register(definition: BlockDefinition): void {
  const usable = {...definition};
  if (!usable.mutator || !Blockly.Extensions.isRegistered(usable.mutator)) delete usable.mutator;
  const conditionalArgs = argsOf(definition).filter((arg) => Array.isArray(arg['only']));
  usable.extensions = (definition.extensions ?? []).filter((extension) => Blockly.Extensions.isRegistered(extension));
  Blockly.Blocks[definition.type] = {
    init(this: Blockly.Block) {
      this.jsonInit(usable);
      for (const arg of conditionalArgs) showInputWhen(this, arg.name ?? '', arg['only'] as [string, string]);
    },
  };
}

/** Shows an input only while a field has one value. */
function showInputWhen(block: Blockly.Block, name: string, [fieldName, wanted]: [string, string]): void {
  const field = block.getField(fieldName);
  const show = (value: unknown) => {
    const input = block.getInput(name);
    if (!input || input.isVisible() === (value === wanted)) return;
    input.setVisible(value === wanted);
    if (block instanceof Blockly.BlockSvg && block.rendered) block.queueRender();
  };
  field?.setValidator((value: unknown) => {
    show(value);
    return undefined;
  });
  show(field?.getValue());
}

/** Adds “ ” around a value block that consists only of a text field. */
function withQuotes(definition: BlockDefinition): BlockDefinition {
  const args = definition['args0'] as BlockArg[] | undefined;
  const only = args?.length === 1 ? args[0] : undefined;
  const message = String(definition['message0']).replace(/[“”\s]/g, '');
  if (!('output' in definition) || message !== '%1' || only?.type !== 'field_input') return definition;
  const quote = (icon: string): BlockArg => ({type: 'field_icon', icon, size: 12});
  return {...definition, message0: '%1 %2 %3', args0: [quote('quote-open'), only, quote('quote-close')]};
}
