// Breakpoints ("Pause here"): the program pauses before such a block. Stored in the block's data, which
// versions of Studio without breakpoints preserve.
import * as Blockly from 'blockly/core';
import {drawIcon} from './icons';
import {t} from './words';

const SVG_NS = 'http://www.w3.org/2000/svg';
const MARK_SIZE = 22;

type BlockData = Record<string, unknown>;

function dataOf(block: Blockly.Block): BlockData {
  try {
    const parsed: unknown = JSON.parse(block.data ?? '{}');
    return typeof parsed === 'object' && parsed !== null && !Array.isArray(parsed) ? parsed as BlockData : {};
  } catch {
    return {};
  }
}

export function hasBreakpoint(block: Blockly.Block): boolean {
  return dataOf(block)['pause'] === true;
}

/** Returns true for statement blocks; the program can't pause before a value. */
export function canHaveBreakpoint(block: Blockly.Block): boolean {
  return block.previousConnection !== null;
}

/** Undoable change of a block's breakpoint. */
class BreakpointChange extends Blockly.Events.BlockBase {
  override type = 'nep_breakpoint';

  constructor(private readonly block: Blockly.Block, private readonly from: string | null, private readonly to: string | null) {
    super(block);
    this.recordUndo = Blockly.Events.getRecordUndo();
  }

  override isNull(): boolean {
    return this.from === this.to;
  }

  override run(forward: boolean): void {
    const block = this.getEventWorkspace_().getBlockById(this.blockId ?? '') ?? this.block;
    const before = block.data;
    block.data = forward ? this.to : this.from;
    updateBreakpointMark(block);
    Blockly.Events.fire(new BreakpointChange(block, before, block.data));  // undo alone notifies no listeners
  }
}

export function toggleBreakpoint(block: Blockly.BlockSvg): void {
  const {pause, ...rest} = dataOf(block);
  const from = block.data;
  const data: BlockData = pause === true ? rest : {...rest, pause: true};
  block.data = Object.keys(data).length ? JSON.stringify(data) : null;
  updateBreakpointMark(block);
  Blockly.Events.fire(new BreakpointChange(block, from, block.data));
}

function updateBreakpointMark(block: Blockly.Block): void {
  if (!(block instanceof Blockly.BlockSvg)) return;
  const root = block.getSvgRoot();
  root.querySelector(':scope > .nepPauseMark')?.remove();
  if (!hasBreakpoint(block)) return;
  const mark = document.createElementNS(SVG_NS, 'g');
  mark.setAttribute('class', 'nepPauseMark');
  mark.setAttribute('transform', `translate(${-MARK_SIZE + 2}, 13)`);
  const title = document.createElementNS(SVG_NS, 'title');
  title.textContent = t('The program pauses before this block');
  const ground = document.createElementNS(SVG_NS, 'circle');
  for (const name of ['cx', 'cy', 'r']) ground.setAttribute(name, `${MARK_SIZE / 2}`);
  const picture = document.createElementNS(SVG_NS, 'g');
  picture.setAttribute('transform', 'translate(4, 4)');
  drawIcon(picture, 'pause', MARK_SIZE - 8);
  mark.append(title, ground, picture);
  root.append(mark);
}

const originalInitSvg = Blockly.BlockSvg.prototype.initSvg;
Blockly.BlockSvg.prototype.initSvg = function (this: Blockly.BlockSvg) {
  originalInitSvg.call(this);
  if (this.data) updateBreakpointMark(this);
};
