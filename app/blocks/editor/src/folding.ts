// Blocks that are folded up to one line: by their menu, or by a double click beside their fields.
import * as Blockly from 'blockly/core';

/** Whether folding shows less: the block holds others, or has room for some. */
export function canFold(block: Blockly.BlockSvg): boolean {
  const below = block.getNextBlock();
  return block.getChildren(false).some((each) => !each.isShadow() && each !== below) ||
    block.inputList.some((input) => input.type === Blockly.inputs.inputTypes.STATEMENT);
}

export function fold(block: Blockly.BlockSvg, folded: boolean): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  block.setCollapsed(folded);
  Blockly.Events.setGroup(group);
}

/** The block that is seen in the place of this one: itself, or the outermost folded one around it. */
export function seenInPlaceOf(block: Blockly.BlockSvg): Blockly.BlockSvg {
  let seen = block;
  for (let each = block.getSurroundParent(); each; each = each.getSurroundParent()) if (each.isCollapsed()) seen = each;
  return seen;
}

const DOUBLE_MS = 450;

/** Fields, buttons and notes have clicks of their own: only what is clicked beside them is told as the block's. */
export function foldOnDoubleClick(workspace: Blockly.WorkspaceSvg): void {
  let [id, at] = ['', 0];
  workspace.addChangeListener((event) => {
    if (!(event instanceof Blockly.Events.Click)) return;
    const now = performance.now();
    const again = event.targetType === 'block' && event.blockId === id && now - at < DOUBLE_MS;
    [id, at] = again ? ['', 0] : [event.blockId ?? '', now];
    const block = again ? workspace.getBlockById(event.blockId ?? '') : null;
    if (block?.isCollapsed()) fold(block, false);
    else if (block && canFold(block)) fold(block, true);
  });
}
