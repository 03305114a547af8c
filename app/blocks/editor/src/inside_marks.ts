// What is inside a folded block and must not be forgotten there: notes, and "Pause here". The folded block has a small
// mark for each kind; the mark unfolds it and leads to the first block that is meant.
import * as Blockly from 'blockly/core';
import {pausesHere} from './breakpoints';
import {fold, seenInPlaceOf} from './folding';
import {drawIcon} from './icons';
import {hasNote, showNote, wordsOfNote} from './notes';
import {t} from './words';

type Block = Blockly.BlockSvg;

const SVG = 'http://www.w3.org/2000/svg';
const SIZE = 22;
/** Right of the block; of a value, which has another block there, over its corner. */
const BESIDE = 6;
const BETWEEN = 4;

interface Kind {
  name: 'note' | 'pause';
  icon: string;
  is(block: Block): boolean;
  words(inside: Block[]): string;
}

const KINDS: readonly Kind[] = [
  {name: 'pause', icon: 'pause', is: pausesHere, words: () => t('The program pauses inside this block. Click to see where')},
  {name: 'note', icon: 'sticky-note', is: hasNote,
    words: (inside) => t('Contains a note: {text}', {text: inside.map(wordsOfNote).filter(Boolean).join(' · ')})},
];

/** Folded blocks, each with the marks that it shows. */
const folded = new Map<Block, SVGElement[]>();

/** All that is hidden inside of a folded block, in the order of reading; not what hangs below it. */
function inside(block: Block): Block[] {
  const below = new Set(block.getNextBlock()?.getDescendants(false) ?? []);
  return block.getDescendants(true).filter((each) => each !== block && !below.has(each));
}

/** The first block of this kind that is hidden in a folded one. */
export function hiddenIn(block: Block, name: Kind['name']): Block | null {
  const kind = KINDS.find((each) => each.name === name)!;
  return block.isCollapsed() ? inside(block).find(kind.is) ?? null : null;
}

/** Unfolds whatever hides it, as one step, and gives it the keys. */
export function leadTo(block: Block): void {
  const group = Blockly.Events.getGroup();
  if (!group) Blockly.Events.setGroup(true);
  for (let each = block.getSurroundParent(); each; each = each.getSurroundParent()) if (each.isCollapsed()) fold(each, false);
  Blockly.Events.setGroup(group);
  Blockly.renderManagement.triggerQueuedRenders(block.workspace);
  Blockly.getFocusManager().focusNode(block);
}

function refresh(block: Block): void {
  for (const mark of folded.get(block) ?? []) mark.remove();
  folded.delete(block);
  if (block.isDeadOrDying()) return;
  const all = inside(block);
  for (const each of all) showNote(each, seenInPlaceOf(each) === each);
  if (!block.isCollapsed()) return;
  const kinds = KINDS.filter((kind) => all.some(kind.is));
  folded.set(block, kinds.map((kind, number) => {
    const mark = draw(block, kind, all.filter(kind.is));
    const [x, y] = block.outputConnection ? [block.childlessWidth - SIZE, -SIZE / 2] :
      [block.childlessWidth + BESIDE, (block.height - SIZE) / 2];
    mark.setAttribute('transform', `translate(${x + number * (SIZE + BETWEEN)}, ${y})`);
    return mark;
  }));
}

function draw(block: Block, kind: Kind, meant: Block[]): SVGElement {
  const make = (name: string, given: Record<string, string | number>) => {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(given)) made.setAttribute(key, String(value));
    return made;
  };
  const words = kind.words(meant);
  const mark = make('g', {'class': `nepInsideMark nepInside-${kind.name}`, 'role': 'button', 'aria-label': words});
  const title = make('title', {});
  title.textContent = words;
  const picture = make('g', {transform: 'translate(4, 4)'});
  drawIcon(picture as SVGGElement, kind.icon, SIZE - 8);
  mark.append(title, make('circle', {cx: SIZE / 2, cy: SIZE / 2, r: SIZE / 2}), picture);
  mark.addEventListener('pointerdown', (event) => event.stopPropagation());
  mark.addEventListener('click', (event) => {
    event.stopPropagation();
    const first = hiddenIn(block, kind.name);
    if (first) leadTo(first);
  });
  block.getSvgRoot().append(mark);
  return mark;
}

const render = Blockly.BlockSvg.prototype.renderEfficiently;
Blockly.BlockSvg.prototype.renderEfficiently = function (this: Block) {
  render.call(this);
  if (this.isCollapsed() || folded.has(this)) refresh(this);
};

/** Keeps the marks true while what is inside of folded blocks changes. */
export function keepInsideMarks(workspace: Blockly.WorkspaceSvg): void {
  let waiting = 0;
  workspace.addChangeListener((event) => {
    if (event.isUiEvent || !folded.size) return;
    waiting ||= window.requestAnimationFrame(() => {
      waiting = 0;
      for (const block of [...folded.keys()]) if (block.workspace === workspace || block.isDeadOrDying()) refresh(block);
    });
  });
}
