// Blocks with a variable number of inputs: items of a list, branches of an "if", inputs of a function.
import * as Blockly from 'blockly/core';
import {FieldButton} from './fields';
import {findFreePosition, visibleArea, obstacles} from './free_place';
import {t} from './words';

const MAX_ITEMS = 50;
export const MAX_INPUTS = 12;

/** Input of a function; its id is constant, its name can change. */
export interface FunctionInput {
  id: string;
  name: string;
}

export const DEFINITIONS = ['functions_define', 'functions_define_result'];
export const CALLS = ['functions_call', 'functions_result'];

/** Changes the shape of a block in one undo step. */
function reshape(block: Blockly.Block, change: () => void): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  const before = JSON.stringify(block.saveExtraState?.() ?? null);
  change();
  const after = JSON.stringify(block.saveExtraState?.() ?? null);
  if (before !== after) {
    Blockly.Events.fire(new (Blockly.Events.get(Blockly.Events.BLOCK_CHANGE))(block, 'mutation', null, before, after));
  }
  if (!group) Blockly.Events.setGroup(false);
}

function appendButtons(block: Blockly.Block, input: Blockly.Input, remove: string, add: string, change: (by: number) => void): void {
  const button = (icon: string, label: string, by: number) =>
    new FieldButton(icon, label, () => reshape(block, () => change(by)));
  input.appendField(button('minus', remove, -1), 'LESS');
  input.appendField(button('plus', add, 1), 'MORE');
}

// ---- list of n items

interface ItemsBlock extends Blockly.Block {
  items: number;
  showItems(count: number): void;
}

const ITEMS = {
  saveExtraState(this: ItemsBlock) {
    return {items: this.items};
  },
  loadExtraState(this: ItemsBlock, state: {items?: unknown} | null) {
    const count = state?.items;
    this.showItems(typeof count === 'number' && Number.isInteger(count) ? count : this.items);
  },
  showItems(this: ItemsBlock, count: number) {
    const targetCount = Math.min(Math.max(count, 0), MAX_ITEMS);
    for (let number = this.items; number > targetCount; number -= 1) this.removeInput(`ITEM${number - 1}`);
    for (let number = this.items; number < targetCount; number += 1) {
      const gap = this.appendValueInput(`ITEM${number}`);
      this.moveInputBefore('BUTTONS', null);
      if (!Blockly.Events.isEnabled()) continue;
      gap.connection?.setShadowState({type: 'values_text', fields: {TEXT: ''}});
    }
    this.items = targetCount;
  },
};

function initItems(this: ItemsBlock): void {
  this.items = 0;
  const row = this.appendDummyInput('BUTTONS');
  appendButtons(this, row, t('Remove the last slot'), t('Add a slot'), (by) => this.showItems(this.items + by));
  const wasEnabled = Blockly.Events.isEnabled();
  if (wasEnabled) Blockly.Events.disable();
  this.showItems(3);
  if (wasEnabled) Blockly.Events.enable();
}

// ---- branches of an "if"

const MAX_ELSE_IFS = 20;

interface BranchesBlock extends Blockly.Block {
  elseIfs: number;
  hasElse: boolean;
  /** True if the block has an "else" by default; the file stores nothing for the default shape. */
  beginsWithElse: boolean;
  showBranches(elseIfs: number, hasElse: boolean): void;
}

const BRANCHES = {
  saveExtraState(this: BranchesBlock) {
    return this.elseIfs || this.hasElse !== this.beginsWithElse ? {elseIfs: this.elseIfs, else: this.hasElse} : null;
  },
  loadExtraState(this: BranchesBlock, state: {elseIfs?: unknown; else?: unknown} | null) {
    const count = state?.elseIfs;
    this.showBranches(typeof count === 'number' && Number.isInteger(count) ? count : 0,
      typeof state?.else === 'boolean' ? state.else : this.beginsWithElse);
  },
  showBranches(this: BranchesBlock, elseIfs: number, hasElse: boolean) {
    const targetCount = Math.min(Math.max(elseIfs, 0), MAX_ELSE_IFS);
    for (let number = this.elseIfs; number > targetCount; number -= 1) {
      for (const name of ['CONDITION', 'LESS', 'BODY']) this.removeInput(`${name}${number}`);
    }
    for (let number = this.elseIfs + 1; number <= targetCount; number += 1) {
      this.appendValueInput(`CONDITION${number}`).setCheck('Boolean').appendField(t('else if'));
      this.appendDummyInput(`LESS${number}`).appendField(createRemoveButton(this, number));
      this.appendStatementInput(`BODY${number}`);
      if (this.hasElse) for (const name of ['CONDITION', 'LESS', 'BODY']) this.moveInputBefore(`${name}${number}`, 'LESS_ELSE');
    }
    this.elseIfs = targetCount;
    if (hasElse === this.hasElse) return;
    this.hasElse = hasElse;
    if (hasElse) {
      this.appendDummyInput('LESS_ELSE').appendField(t('else')).appendField(createRemoveButton(this, 0));
      this.appendStatementInput('ELSE');
    } else {
      this.removeInput('LESS_ELSE');
      this.removeInput('ELSE');
    }
  },
};

function createRemoveButton(block: BranchesBlock, number: number): FieldButton {
  return new FieldButton('minus', t('Remove this branch'), () => removeBranch(block, number));
}

function initBranches(this: BranchesBlock): void {
  this.elseIfs = 0;
  this.hasElse = this.beginsWithElse = this.getInput('ELSE') !== null;
  this.appendDummyInput('MORE').appendField(new FieldButton('plus', t('Add a branch'), () => addBranch(this)));
  this.moveInputBefore('MORE', 'BODY');
  const row = this.inputList[this.inputList.findIndex((input) => input.name === 'ELSE') - 1];
  if (!this.hasElse || !row) return;
  row.name = 'LESS_ELSE';
  row.appendField(createRemoveButton(this, 0));
}

/** Adds an "else" first, then an "else if" above it. */
export function addBranch(block: BranchesBlock, elseIf = block.hasElse): void {
  reshape(block, () => block.showBranches(block.elseIfs + (elseIf ? 1 : 0), block.hasElse || !elseIf));
}

/** Removes the "else if" with that number, or the "else" for 0; the blocks in it are detached. */
function removeBranch(block: BranchesBlock, number: number): void {
  reshape(block, () => {
    const childOf = (name: string) => block.getInput(name)?.connection?.targetBlock() ?? null;
    const freed: Blockly.Block[] = [];
    for (const name of number ? [`CONDITION${number}`, `BODY${number}`] : ['ELSE']) {
      const child = childOf(name);
      child?.unplug(false);
      if (child?.isShadow()) child.dispose(false);
      else if (child) freed.push(child);
    }
    // Move the branches below up.
    for (let next = number + 1; number && next <= block.elseIfs; next += 1) {
      for (const name of ['CONDITION', 'BODY']) {
        const moved = childOf(`${name}${next}`);
        const connection = moved?.outputConnection ?? moved?.previousConnection;
        moved?.unplug(false);
        if (connection) block.getInput(`${name}${next - 1}`)?.connection?.connect(connection);
      }
    }
    block.showBranches(block.elseIfs - (number ? 1 : 0), block.hasElse && number > 0);
    if (block instanceof Blockly.BlockSvg) for (const freedBlock of freed) moveBeside(freedBlock as Blockly.BlockSvg, block);
  });
}

/** Moves a detached block to a free visible position beside the block. */
function moveBeside(freed: Blockly.BlockSvg, block: Blockly.BlockSvg): void {
  const {workspace} = block;
  Blockly.renderManagement.triggerQueuedRenders(workspace);
  const {right} = block.getRootBlock().getBoundingRectangle();
  const {width, height} = freed.getHeightWidth();
  const requested = new Blockly.utils.Coordinate(right, freed.getRelativeToSurfaceXY().y);
  const position = findFreePosition(requested, {width, height}, obstacles(workspace, new Set([freed])), visibleArea(workspace));
  const {x, y} = freed.getRelativeToSurfaceXY();
  freed.moveBy(position.x - x, position.y - y);
}

/** Returns the block as an "if" with branches, or null if it is another block. */
export function branchesOf(block: Blockly.Block | undefined): BranchesBlock | null {
  return block && 'showBranches' in block ? block as BranchesBlock : null;
}

// ---- function definition

/** Name of a function's input; stored in the extra state of the function block. */
class FieldInputName extends Blockly.FieldTextInput {
  override SERIALIZABLE = false;

  override isSerializable(): boolean {
    return false;
  }
}

export interface DefinitionBlock extends Blockly.Block {
  own: FunctionInput[];
  showInputs(inputs: FunctionInput[]): void;
}

export function readInputs(saved: unknown): FunctionInput[] {
  const inputsById = new Map<string, FunctionInput>();
  for (const entry of Array.isArray(saved) ? saved : []) {
    const {id, name} = (entry ?? {}) as Partial<FunctionInput>;
    if (typeof id === 'string' && id && !inputsById.has(id)) inputsById.set(id, {id, name: String(name || 'input').slice(0, 60)});
  }
  return [...inputsById.values()].slice(0, MAX_INPUTS);
}

/** Returns an unused name: "input", "input 2". */
export function freshName(stem: string, usedNames: Iterable<string>): string {
  const all = new Set(usedNames);
  let name = stem;
  for (let number = 2; all.has(name); number += 1) name = `${stem} ${number}`;
  return name;
}

const FUNCTION = {
  saveExtraState(this: DefinitionBlock) {
    return this.own.length ? {inputs: this.own.map((input) => ({...input}))} : null;
  },
  loadExtraState(this: DefinitionBlock, state: {inputs?: unknown} | null) {
    this.showInputs(readInputs(state?.inputs));
  },
  showInputs(this: DefinitionBlock, inputs: FunctionInput[]) {
    const row = this.getInput('INPUTS');
    if (!row) return;
    for (const field of [...row.fieldRow]) if (/^(WITH|INPUT\d+|LESS|MORE)$/.test(field.name ?? '')) row.removeField(field.name!);
    this.own = inputs.map((input) => ({...input}));
    if (inputs.length) row.appendField(t('with'), 'WITH');
    this.own.forEach((input, number) => row.appendField(nameField(this, input), `INPUT${number}`));
    appendButtons(this, row, t('Remove the last input'), t('Add an input'), (by) => shapeInputs(this, by, this.own.length - 1));
  },
};

function nameField(block: DefinitionBlock, input: FunctionInput): Blockly.Field {
  const field = new FieldInputName(input.name, (text: string) => {
    const name = text.replace(/\s+/g, ' ').trim().slice(0, 60);
    if (!name) return null;
    const ownInput = block.own.find((candidate) => candidate.id === input.id);
    if (ownInput) ownInput.name = name;
    return name;
  });
  field.setTooltip(t('Input name'));
  return field;
}

/** Adds an input, or removes the one at `index` if `by` is negative, in one undo step. */
export function changeInputs(block: DefinitionBlock, by: number, index: number): void {
  reshape(block, () => shapeInputs(block, by, index));
}

function shapeInputs(block: DefinitionBlock, by: number, index: number): void {
  if (by < 0) {
    block.showInputs(block.own.filter((_each, number) => number !== index));
  } else if (block.own.length < MAX_INPUTS) {
    const name = freshName(t('input'), block.own.map((input) => input.name));
    block.showInputs([...block.own, {id: Blockly.utils.idGenerator.genUid(), name}]);
  }
}

function initFunction(this: DefinitionBlock): void {
  this.showInputs([]);
  this.getField('NAME')?.setValidator((text: string) => {
    const name = text.replace(/\s+/g, ' ').trim().slice(0, 60);
    return name ? freshName(name, otherFunctionNames(this)) : null;
  });
}

function otherFunctionNames(block: Blockly.Block): string[] {
  if (block.isInFlyout) return [];
  return definitionsOf(block.workspace).filter((definition) => definition.id !== block.id).map(functionName);
}

export function definitionsOf(workspace: Blockly.Workspace): DefinitionBlock[] {
  return DEFINITIONS.flatMap((type) => workspace.getBlocksByType(type, false)) as DefinitionBlock[];
}

export function functionName(definition: Blockly.Block): string {
  return String(definition.getFieldValue('NAME') ?? '');
}

// ---- function call

export interface CallBlock extends Blockly.Block {
  target: string;
  called: string;
  own: FunctionInput[];
  showCall(target: string, name: string, inputs: FunctionInput[]): void;
}

const CALL = {
  saveExtraState(this: CallBlock) {
    return {function: this.target, name: this.called, inputs: this.own.map((input) => ({...input}))};
  },
  loadExtraState(this: CallBlock, state: {function?: unknown; name?: unknown; inputs?: unknown} | null) {
    const target = typeof state?.function === 'string' ? state.function : '';
    this.showCall(target, String(state?.name ?? 'function').slice(0, 60), readInputs(state?.inputs));
  },
  showCall(this: CallBlock, target: string, name: string, inputs: FunctionInput[]) {
    this.target = target;
    this.called = name;
    this.setFieldValue(name, 'NAME');
    for (const input of this.own) {
      if (!inputs.some((other) => other.id === input.id)) this.removeInput(`IN_${input.id}`);
    }
    for (const input of inputs) {
      const gap = this.getInput(`IN_${input.id}`);
      if (gap) gap.fieldRow[0]?.setValue(input.name);
      else this.appendValueInput(`IN_${input.id}`).appendField(new Blockly.FieldLabel(input.name));
      this.moveInputBefore(`IN_${input.id}`, null);
    }
    this.own = inputs.map((input) => ({...input}));
  },
};

function initCall(this: CallBlock): void {
  this.own = [];
  this.target = '';
  this.called = 'function';
  this.getInput('INPUTS')?.appendField(new Blockly.FieldLabel('function'), 'NAME');
}

/** Updates a call with the name and inputs of its function. */
export function updateCall(call: CallBlock, definition: DefinitionBlock): void {
  const name = functionName(definition);
  const isUpToDate = call.target === definition.id && call.called === name && JSON.stringify(call.own) === JSON.stringify(definition.own);
  if (!isUpToDate) reshape(call, () => call.showCall(definition.id, name, definition.own));
}

// ---- input inside a function

/** Returns the function definition that contains the block. */
function enclosingDefinition(block: Blockly.Block): DefinitionBlock | null {
  const root = block.getRootBlock();
  return DEFINITIONS.includes(root.type) ? root as DefinitionBlock : null;
}

/** Label with the name of an input; its value is the input's id. */
export class FieldFunctionInput extends Blockly.FieldLabelSerializable {
  protected override getText_(): string {
    const block = this.getSourceBlock();
    const id = String(this.value_ ?? '');
    if (!block) return id;
    const main = (block.workspace as Blockly.WorkspaceSvg).targetWorkspace ?? block.workspace;
    const enclosing = enclosingDefinition(block);
    const all = [...(enclosing ? [enclosing] : []), ...definitionsOf(main)].flatMap((definition) => definition.own ?? []);
    return all.find((input) => input.id === id)?.name ?? 'input';
  }

  static override fromJson(_config: Blockly.FieldConfig): FieldFunctionInput {
    return new FieldFunctionInput('');
  }
}

Blockly.fieldRegistry.register('field_function_input', FieldFunctionInput);
Blockly.Extensions.registerMutator('nep_items', ITEMS, initItems);
Blockly.Extensions.registerMutator('nep_branches', BRANCHES, initBranches);
Blockly.Extensions.registerMutator('nep_function', FUNCTION, initFunction);
Blockly.Extensions.registerMutator('nep_call', CALL, initCall);
