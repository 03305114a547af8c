// Blocks that are folded up to one line: by their menu, or by a double click beside their fields.
import * as Blockly from 'blockly/core';

/** Whether folding shows less: the block holds others, or has room for some. */
export function canCollapse(block: Blockly.BlockSvg): boolean {
  const below = block.getNextBlock();
  return block.getChildren(false).some((child) => !child.isShadow() && child !== below) ||
    block.inputList.some((input) => input.type === Blockly.inputs.inputTypes.STATEMENT);
}

export function setCollapsed(block: Blockly.BlockSvg, folded: boolean): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  block.setCollapsed(folded);
  Blockly.Events.setGroup(group);
}

/** The block that is seen in the place of this one: itself, or the outermost folded one around it. */
export function visibleBlockOf(block: Blockly.BlockSvg): Blockly.BlockSvg {
  let visible = block;
  for (let ancestor = block.getSurroundParent(); ancestor; ancestor = ancestor.getSurroundParent()) if (ancestor.isCollapsed()) visible = ancestor;
  return visible;
}

const DOUBLE_CLICK_MS = 450;

/** Fields, buttons and notes have clicks of their own: only what is clicked beside them is told as the block's. */
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
