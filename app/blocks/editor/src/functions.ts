// Functions of a behaviour: keeps calls in sync with their definitions and lists the functions in the toolbox.
import * as Blockly from 'blockly/core';
import {CALLS, type CallBlock, type DefinitionBlock, FieldFunctionInput, definitionsOf, freshName,
  functionName, updateCall} from './mutators';
import {Toolbox} from './toolbox';

export const FUNCTIONS = 'functions';

export class Functions {
  /** Ids, names and inputs of the functions at the last check. */
  private snapshot = '';

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    workspace.addChangeListener((event) => this.onEvent(event));
    workspace.registerToolboxCategoryCallback(FUNCTIONS, () => this.flyoutContents());
  }

  /** Updates everything after other blocks were loaded. */
  refresh(): void {
    this.snapshot = this.takeSnapshot();
    this.renameInputs();
  }

  private takeSnapshot(): string {
    return JSON.stringify(definitionsOf(this.workspace).map((definition) => [definition.id, functionName(definition), definition.own]));
  }

  private onEvent(event: Blockly.Events.Abstract): void {
    const creates = event.type === Blockly.Events.BLOCK_CREATE;
    if (!creates && event.type !== Blockly.Events.BLOCK_CHANGE && event.type !== Blockly.Events.BLOCK_DELETE) return;
    const now = this.takeSnapshot();
    if (now === this.snapshot && !(creates && this.callBlocks().length)) return;
    // Keep the update in the group of its cause; after an undo it isn't recorded.
    const recording = Blockly.Events.getRecordUndo();
    const group = Blockly.Events.getGroup();
    Blockly.Events.setRecordUndo(event.recordUndo);
    Blockly.Events.setGroup(event.group || true);
    if (creates && event.recordUndo) this.makeNamesUnique(event as Blockly.Events.BlockCreate);
    this.updateCalls();
    Blockly.Events.setGroup(group);
    Blockly.Events.setRecordUndo(recording);
    if (now === this.snapshot) return;
    this.snapshot = this.takeSnapshot();
    this.renameInputs();
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox) toolbox.refreshDynamic(FUNCTIONS);
  }

  private callBlocks(): CallBlock[] {
    return CALLS.flatMap((type) => this.workspace.getBlocksByType(type, false)) as CallBlock[];
  }

  /** Gives a copied function a unique name. */
  private makeNamesUnique(event: Blockly.Events.BlockCreate): void {
    const createdIds = new Set(event.ids ?? []);
    const all = definitionsOf(this.workspace);
    for (const definition of all) {
      if (!createdIds.has(definition.id)) continue;
      const others = all.filter((other) => other !== definition).map(functionName);
      const name = freshName(functionName(definition), others);
      if (name !== functionName(definition)) definition.setFieldValue(name, 'NAME');
    }
  }

  private updateCalls(): void {
    const definitions = definitionsOf(this.workspace);
    const byName = new Map(definitions.map((definition) => [functionName(definition), definition]));
    const byId = new Map(definitions.map((definition) => [definition.id, definition]));
    for (const call of this.callBlocks()) {
      const definition = byId.get(call.target) ?? byName.get(call.called);
      if (definition) updateCall(call, definition);
    }
  }

  private renameInputs(): void {
    const flyout = this.workspace.getFlyout()?.getWorkspace();
    for (const workspace of flyout ? [this.workspace, flyout] : [this.workspace]) {
      for (const block of workspace.getBlocksByType('functions_input', false)) {
        const field = block.getField('INPUT');
        if (field instanceof FieldFunctionInput) field.forceRerender();
      }
    }
  }

  /** Returns the static blocks, and each function's call blocks and inputs. */
  private flyoutContents(): Blockly.utils.toolbox.FlyoutItemInfoArray {
    const toolbox = this.workspace.getToolbox();
    const staticItems = toolbox instanceof Toolbox ? toolbox.contentsOf(FUNCTIONS) : [];
    return [...staticItems, ...definitionsOf(this.workspace).flatMap(flyoutItemsFor)] as Blockly.utils.toolbox.FlyoutItemInfoArray;
  }
}

function flyoutItemsFor(definition: DefinitionBlock): unknown[] {
  const extraState = {function: definition.id, name: functionName(definition), inputs: definition.own};
  const uses = definition.type === 'functions_define_result' ? ['functions_result', 'functions_call'] : ['functions_call'];
  return [
    ...uses.map((type) => ({kind: 'block', type, extraState})),
    ...definition.own.map((input) => ({kind: 'block', type: 'functions_input', fields: {INPUT: input.id}})),
  ];
}
