// The functions of a behaviour: uses follow their function, and the toolbox offers them.
import * as Blockly from 'blockly/core';
import {CALLS, type CallBlock, type DefinitionBlock, FieldFunctionInput, definitionsOf, freshName,
  functionName, updateCall} from './mutators';
import {Toolbox} from './toolbox';

export const FUNCTIONS = 'functions';

export class Functions {
  /** What there was when it was last looked at: ids, names, inputs. */
  private known = '';

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {
    workspace.addChangeListener((event) => this.onEvent(event));
    workspace.registerToolboxCategoryCallback(FUNCTIONS, () => this.offered());
  }

  /** Another program is here. */
  refresh(): void {
    this.known = this.look();
    this.renameInputs();
  }

  private look(): string {
    return JSON.stringify(definitionsOf(this.workspace).map((each) => [each.id, functionName(each), each.own]));
  }

  private onEvent(event: Blockly.Events.Abstract): void {
    const creates = event.type === Blockly.Events.BLOCK_CREATE;
    if (!creates && event.type !== Blockly.Events.BLOCK_CHANGE && event.type !== Blockly.Events.BLOCK_DELETE) return;
    const now = this.look();
    if (now === this.known && !(creates && this.calls().length)) return;
    // What follows from an undo is no step of its own.
    const recording = Blockly.Events.getRecordUndo();
    const group = Blockly.Events.getGroup();
    Blockly.Events.setRecordUndo(event.recordUndo);
    Blockly.Events.setGroup(event.group || true);
    if (creates && event.recordUndo) this.nameAnew(event as Blockly.Events.BlockCreate);
    this.followAll();
    Blockly.Events.setGroup(group);
    Blockly.Events.setRecordUndo(recording);
    if (now === this.known) return;
    this.known = this.look();
    this.renameInputs();
    const toolbox = this.workspace.getToolbox();
    if (toolbox instanceof Toolbox) toolbox.refreshDynamic(FUNCTIONS);
  }

  private calls(): CallBlock[] {
    return CALLS.flatMap((type) => this.workspace.getBlocksByType(type, false)) as CallBlock[];
  }

  /** A copy of a function gets a name of its own. */
  private nameAnew(event: Blockly.Events.BlockCreate): void {
    const made = new Set(event.ids ?? []);
    const all = definitionsOf(this.workspace);
    for (const each of all) {
      if (!made.has(each.id)) continue;
      const others = all.filter((other) => other !== each).map(functionName);
      const name = freshName(functionName(each), others);
      if (name !== functionName(each)) each.setFieldValue(name, 'NAME');
    }
  }

  private followAll(): void {
    const definitions = definitionsOf(this.workspace);
    const byName = new Map(definitions.map((each) => [functionName(each), each]));
    const byId = new Map(definitions.map((each) => [each.id, each]));
    for (const call of this.calls()) {
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

  /** The uses of each function, and its inputs. */
  private offered(): Blockly.utils.toolbox.FlyoutItemInfoArray {
    const toolbox = this.workspace.getToolbox();
    const given = toolbox instanceof Toolbox ? toolbox.contentsOf(FUNCTIONS) : [];
    return [...given, ...definitionsOf(this.workspace).flatMap(offer)] as Blockly.utils.toolbox.FlyoutItemInfoArray;
  }
}

function offer(definition: DefinitionBlock): unknown[] {
  const extraState = {function: definition.id, name: functionName(definition), inputs: definition.own};
  const uses = definition.type === 'functions_define_result' ? ['functions_result', 'functions_call'] : ['functions_call'];
  return [
    ...uses.map((type) => ({kind: 'block', type, extraState})),
    ...definition.own.map((each) => ({kind: 'block', type: 'functions_input', fields: {INPUT: each.id}})),
  ];
}
