// Marks on a collapsed block for what is hidden inside: notes and breakpoints ("Pause here"). One mark for
// each kind; a click expands the block and moves to the first hidden block of that kind.
import * as Blockly from 'blockly/core';
import {hasBreakpoint} from './breakpoints';
import {setCollapsed, visibleBlockOf} from './folding';
import {drawIcon} from './icons';
import {hasNote, setNoteVisible, getNoteText} from './notes';
import {t} from './words';

type Block = Blockly.BlockSvg;

const SVG_NS = 'http://www.w3.org/2000/svg';
const MARK_SIZE = 22;
/** Distance to the right of the block; on a value block the marks are over its corner, as its right is occupied. */
const MARK_MARGIN = 6;
const MARK_SPACING = 4;

interface MarkKind {
  name: 'note' | 'pause';
  icon: string;
  is(block: Block): boolean;
  words(blocks: Block[]): string;
}

const MARK_KINDS: readonly MarkKind[] = [
  {name: 'pause', icon: 'pause', is: hasBreakpoint, words: () => t('The program pauses inside this block. Click to see where.')},
  {name: 'note', icon: 'sticky-note', is: hasNote,
    words: (blocks) => t('Contains a note: {text}', {text: blocks.map(getNoteText).filter(Boolean).join(' · ')})},
];

/** Marks shown on each collapsed block. */
const marksByBlock = new Map<Block, SVGElement[]>();

/** Returns the blocks hidden in a collapsed block in reading order, without the blocks below it. */
function hiddenBlocks(block: Block): Block[] {
  const below = new Set(block.getNextBlock()?.getDescendants(false) ?? []);
  return block.getDescendants(true).filter((descendant) => descendant !== block && !below.has(descendant));
}

/** Returns the first block of this kind that is hidden in a collapsed block. */
export function findHidden(block: Block, name: MarkKind['name']): Block | null {
  const kind = MARK_KINDS.find((candidate) => candidate.name === name)!;
  return block.isCollapsed() ? hiddenBlocks(block).find(kind.is) ?? null : null;
}

/** Expands all blocks that hide this one, in one undo step, and focuses it. */
export function revealBlock(block: Block): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  for (let ancestor = block.getSurroundParent(); ancestor; ancestor = ancestor.getSurroundParent()) if (ancestor.isCollapsed()) setCollapsed(ancestor, false);
  Blockly.Events.setGroup(group);
  Blockly.renderManagement.triggerQueuedRenders(block.workspace);
  Blockly.getFocusManager().focusNode(block);
}

function updateMarks(block: Block): void {
  for (const mark of marksByBlock.get(block) ?? []) mark.remove();
  marksByBlock.delete(block);
  if (block.isDeadOrDying()) return;
  const all = hiddenBlocks(block);
  for (const hidden of all) setNoteVisible(hidden, visibleBlockOf(hidden) === hidden);
  if (!block.isCollapsed()) return;
  const kinds = MARK_KINDS.filter((kind) => all.some(kind.is));
  marksByBlock.set(block, kinds.map((kind, number) => {
    const mark = createMark(block, kind, all.filter(kind.is));
    const [x, y] = block.outputConnection ? [block.childlessWidth - MARK_SIZE, -MARK_SIZE / 2] :
      [block.childlessWidth + MARK_MARGIN, (block.height - MARK_SIZE) / 2];
    mark.setAttribute('transform', `translate(${x + number * (MARK_SIZE + MARK_SPACING)}, ${y})`);
    return mark;
  }));
}

function createMark(block: Block, kind: MarkKind, targets: Block[]): SVGElement {
  const make = (name: string, attributes: Record<string, string | number>) => {
    const element = document.createElementNS(SVG_NS, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
    return element;
  };
  const label = kind.words(targets);
  const mark = make('g', {'class': `nepInsideMark nepInside-${kind.name}`, 'role': 'button', 'aria-label': label});
  const title = make('title', {});
  title.textContent = label;
  const picture = make('g', {transform: 'translate(4, 4)'});
  drawIcon(picture as SVGGElement, kind.icon, MARK_SIZE - 8);
  mark.append(title, make('circle', {cx: MARK_SIZE / 2, cy: MARK_SIZE / 2, r: MARK_SIZE / 2}), picture);
  mark.addEventListener('pointerdown', (event) => event.stopPropagation());
  mark.addEventListener('click', (event) => {
    event.stopPropagation();
    const first = findHidden(block, kind.name);
    if (first) revealBlock(first);
  });
  block.getSvgRoot().append(mark);
  return mark;
}

const originalRenderEfficiently = Blockly.BlockSvg.prototype.renderEfficiently;
Blockly.BlockSvg.prototype.renderEfficiently = function (this: Block) {
  originalRenderEfficiently.call(this);
  if (this.isCollapsed() || marksByBlock.has(this)) updateMarks(this);
};

/** Updates the marks when the blocks inside collapsed blocks change. */
export function registerInsideMarks(workspace: Blockly.WorkspaceSvg): void {
  let waiting = 0;
  workspace.addChangeListener((event) => {
    if (event.isUiEvent || !marksByBlock.size) return;
    waiting ||= window.requestAnimationFrame(() => {
      waiting = 0;
      for (const block of [...marksByBlock.keys()]) if (block.workspace === workspace || block.isDeadOrDying()) updateMarks(block);
    });
  });
}
