// Context menu entries that remove an item of a list or an input of a function, and add branches.
import * as Blockly from 'blockly/core';
import {withoutTypeChecks} from './checker';
import {definitionOf} from './definitions';
import {DEFINITIONS, type DefinitionBlock, MAX_INPUTS, addBranch, branchesOf, changeInputs} from './mutators';
import {lazy, t} from './words';

interface Item {
  list: Blockly.BlockSvg;
  number: number;
}

type State = Blockly.serialization.blocks.State;

/** Returns the list item that contains this block, directly or as a shadow value inside it. */
function itemOf(start: Blockly.Block | null): Item | null {
  let block = start;
  for (let parent = block?.getParent(); block && parent; parent = block.getParent()) {
    const inputName = definitionOf(parent.type)?.mutator === 'nep_items' ? parent.getInputWithBlock(block)?.name : '';
    const number = /^ITEM(\d+)$/.exec(inputName ?? '')?.[1];
    if (number !== undefined) return {list: parent as Blockly.BlockSvg, number: Number(number)};
    if (!block.isShadow()) return null;
    block = parent;
  }
  return null;
}

/** Removes the item and its contents by recreating the list, as one undo step. */
function removeItem({list, number}: Item): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  const parentConnection = (list.outputConnection ?? list.previousConnection)?.targetConnection ?? null;
  const saved = Blockly.serialization.blocks.save(list, {addCoordinates: true}) as State;
  const {workspace} = list;
  list.dispose(false);
  const newList = withoutTypeChecks(() => {
    const block = Blockly.serialization.blocks.append(withoutItem(saved, number), workspace, {recordUndo: true});
    const connection = block.outputConnection ?? block.previousConnection;
    if (parentConnection && connection) parentConnection.connect(connection);
    return block as Blockly.BlockSvg;
  });
  if (!group) Blockly.Events.setGroup(false);
  const neighbour = newList.getInput(`ITEM${Math.max(0, number - 1)}`)?.connection?.targetBlock();
  const next = neighbour instanceof Blockly.BlockSvg ? neighbour : newList;
  // Focus after Blockly has moved the focus of the deleted list to a neighbour.
  window.setTimeout(() => !next.isDeadOrDying() && Blockly.getFocusManager().focusNode(next));
}

function withoutItem(saved: State, number: number): State {
  const items = (saved.extraState as {items: number}).items;
  const inputs: NonNullable<State['inputs']> = {};
  for (const [name, each] of Object.entries(saved.inputs ?? {})) {
    const index = Number(/^ITEM(\d+)$/.exec(name)?.[1] ?? -1);
    if (index !== number) inputs[index > number ? `ITEM${index - 1}` : name] = each;
  }
  return {...saved, inputs, extraState: {...saved.extraState, items: items - 1}};
}

// ---- Context menu

/** Shadow block that had the focus; Blockly opens the context menu of its parent. */
let menuBlock: Blockly.BlockSvg | null = null;
let menuItem: Item | null = null;

const baseShowContextMenu = Blockly.BlockSvg.prototype.showContextMenu;
Blockly.BlockSvg.prototype.showContextMenu = function (this: Blockly.BlockSvg, event: Event) {
  const first = menuBlock === null;
  menuBlock ??= this;
  try {
    baseShowContextMenu.call(this, event);
  } finally {
    if (first) menuBlock = null;
  }
};

function findMenuItem(block: Blockly.BlockSvg, event: Event): Item | null {
  const pressed = event instanceof PointerEvent && event.target instanceof Element ? event.target : null;
  const id = pressed?.closest<SVGElement>('[data-id]')?.dataset['id'];
  return itemOf((id ? block.workspace.getBlockById(id) : null) ?? menuBlock ?? block);
}

export function registerRemoveMenu(): void {
  const scopeType = Blockly.ContextMenuRegistry.ScopeType.BLOCK;
  Blockly.ContextMenuRegistry.registry.register({
    id: 'nepRemoveItem', weight: 81, scopeType,
    displayText: () => t('Remove item {number} from the list', {number: (menuItem?.number ?? 0) + 1}),
    preconditionFn: ({block}, event) => {
      menuItem = block && !block.isInFlyout ? findMenuItem(block, event) : null;
      return menuItem ? 'enabled' : 'hidden';
    },
    callback: () => menuItem && removeItem(menuItem),
  });
  for (const [id, isElseIf, words] of [['nepAddElseIf', true, lazy('Add “else if”')], ['nepAddElse', false, lazy('Add “else”')]] as const) {
    Blockly.ContextMenuRegistry.registry.register({
      id, weight: isElseIf ? 81.2 : 81.4, scopeType,
      displayText: () => t(words),
      preconditionFn: ({block}) => {
        const branches = block && !block.isInFlyout && !block.isCollapsed() ? branchesOf(block) : null;
        return branches && (isElseIf || !branches.hasElse) ? 'enabled' : 'hidden';
      },
      callback: ({block}) => {
        const branches = branchesOf(block);
        if (branches) addBranch(branches, isElseIf);
      },
    });
  }
  for (let index = 0; index < MAX_INPUTS; index += 1) {
    const inputOf = (block?: Blockly.BlockSvg) =>
      block && DEFINITIONS.includes(block.type) && !block.isInFlyout ? (block as unknown as DefinitionBlock).own[index] : undefined;
    Blockly.ContextMenuRegistry.registry.register({
      id: `nepRemoveInput${index}`, weight: 82 + index / 100, scopeType,
      displayText: ({block}) => t('Remove the input “{input}”', {input: inputOf(block)?.name ?? ''}),
      preconditionFn: ({block}) => inputOf(block) ? 'enabled' : 'hidden',
      callback: ({block}) => block && changeInputs(block as unknown as DefinitionBlock, -1, index),
    });
  }
}
