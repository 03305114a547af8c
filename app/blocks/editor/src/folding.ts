// Collapsing of blocks by their menu or by a double click beside their fields.
import * as Blockly from 'blockly/core';

/** Returns true if collapsing hides anything: the block contains blocks or has a statement slot. */
export function canCollapse(block: Blockly.BlockSvg): boolean {
  const below = block.getNextBlock();
  return block.getChildren(false).some((child) => !child.isShadow() && child !== below) ||
    block.inputList.some((input) => input.type === Blockly.inputs.inputTypes.STATEMENT);
}

export function setCollapsed(block: Blockly.BlockSvg, isCollapsed: boolean): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  block.setCollapsed(isCollapsed);
  Blockly.Events.setGroup(group);
}

/** Returns the block shown in place of this one: itself, or the outermost collapsed block around it. */
export function visibleBlockOf(block: Blockly.BlockSvg): Blockly.BlockSvg {
  let visible = block;
  for (let ancestor = block.getSurroundParent(); ancestor; ancestor = ancestor.getSurroundParent()) if (ancestor.isCollapsed()) visible = ancestor;
  return visible;
}

const DOUBLE_CLICK_MS = 450;

/** Collapses or expands a block on a double click; Blockly reports clicks on fields and notes separately. */
export function collapseOnDoubleClick(workspace: Blockly.WorkspaceSvg): void {
  let [id, at] = ['', 0];
  workspace.addChangeListener((event) => {
    if (!(event instanceof Blockly.Events.Click)) return;
    const now = performance.now();
    const isDoubleClick = event.targetType === 'block' && event.blockId === id && now - at < DOUBLE_CLICK_MS;
    [id, at] = isDoubleClick ? ['', 0] : [event.blockId ?? '', now];
    const block = isDoubleClick ? workspace.getBlockById(event.blockId ?? '') : null;
    if (block?.isCollapsed()) setCollapsed(block, false);
    else if (block && canCollapse(block)) setCollapsed(block, true);
  });
}
