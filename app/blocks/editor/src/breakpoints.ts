// "Pause here": before such a block the program pauses. Kept in the block's data, which a Studio that knows no
// breakpoints writes back as they are.
import * as Blockly from 'blockly/core';
import {drawIcon} from './icons';
import {t} from './words';

const SVG = 'http://www.w3.org/2000/svg';
const SIZE = 22;

type Data = Record<string, unknown>;

function dataOf(block: Blockly.Block): Data {
  try {
    const told: unknown = JSON.parse(block.data ?? '{}');
    return typeof told === 'object' && told !== null && !Array.isArray(told) ? told as Data : {};
  } catch {
    return {};
  }
}

export function pausesHere(block: Blockly.Block): boolean {
  return dataOf(block)['pause'] === true;
}

/** Only what is done one after the other can be paused before. */
export function canPause(block: Blockly.Block): boolean {
  return block.previousConnection !== null;
}

/** One step of undo. */
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
    showMark(block);
    Blockly.Events.fire(new BreakpointChange(block, before, block.data));  // undo itself is told to nobody
  }
}

export function togglePause(block: Blockly.BlockSvg): void {
  const {pause, ...rest} = dataOf(block);
  const from = block.data;
  const data: Data = pause === true ? rest : {...rest, pause: true};
  block.data = Object.keys(data).length ? JSON.stringify(data) : null;
  showMark(block);
  Blockly.Events.fire(new BreakpointChange(block, from, block.data));
}

function showMark(block: Blockly.Block): void {
  if (!(block instanceof Blockly.BlockSvg)) return;
  const root = block.getSvgRoot();
  root.querySelector(':scope > .nepPauseMark')?.remove();
  if (!pausesHere(block)) return;
  const mark = document.createElementNS(SVG, 'g');
  mark.setAttribute('class', 'nepPauseMark');
  mark.setAttribute('transform', `translate(${-SIZE + 2}, 13)`);
  const title = document.createElementNS(SVG, 'title');
  title.textContent = t('The program pauses before this block');
  const ground = document.createElementNS(SVG, 'circle');
  for (const name of ['cx', 'cy', 'r']) ground.setAttribute(name, `${SIZE / 2}`);
  const picture = document.createElementNS(SVG, 'g');
  picture.setAttribute('transform', 'translate(4, 4)');
  drawIcon(picture, 'pause', SIZE - 8);
  mark.append(title, ground, picture);
  root.append(mark);
}

const init = Blockly.BlockSvg.prototype.initSvg;
Blockly.BlockSvg.prototype.initSvg = function (this: Blockly.BlockSvg) {
  init.call(this);
  if (this.data) showMark(this);
};
