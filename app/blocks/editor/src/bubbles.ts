// Sentences beside blocks: what failed, what a person is warned of.
import * as Blockly from 'blockly/core';
import {seenInPlaceOf} from './folding';
import {drawIcon} from './icons';

export type BubbleKind = 'error' | 'warning';
export type Said = readonly [kind: BubbleKind, sentence: string];

const SVG = 'http://www.w3.org/2000/svg';
const BUBBLE_WIDTH = 300;
const GAP = 14;
const EDGE = 8;
/** A block's first row: a bubble of a long script stands by it. */
const ROW = 64;
/** The scrollbar, in pixels of the page. */
const BAR = 15;
/** Below this scale a sentence does not shrink any more. */
const LEAST_SCALE = 0.8;

type Tip = 'left' | 'top' | 'bottom';

interface Bubble {
  group: SVGGElement;
  frame: SVGPathElement;
  width: number;
  height: number;
  tip: Tip | '';
}
const ICONS: Readonly<Record<BubbleKind, string>> = {error: 'circle-x', warning: 'triangle-alert'};

/** One bubble a block, beside it and wholly in sight; it scales with the workspace, but not below what can be read. */
export class Bubbles {
  private said: ReadonlyMap<string, Said> = new Map();
  private readonly shown = new Map<string, Bubble>();
  private placing = 0;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {}

  /** Exactly these from now on, by the block's id. */
  say(said: ReadonlyMap<string, Said>): void {
    this.said = said;
    this.place();
  }

  /** Blocks have moved or changed; a workspace without bubbles costs nothing. */
  placeSoon(): void {
    if (this.placing || !(this.said.size || this.shown.size)) return;
    this.placing = window.requestAnimationFrame(() => {
      this.placing = 0;
      this.place();
    });
  }

  private place(): void {
    for (const [id, bubble] of this.shown) {
      if (this.said.get(id)?.join(' ') !== bubble.group.dataset['said'] || !this.workspace.getBlockById(id)) {
        bubble.group.remove();
        this.shown.delete(id);
      }
    }
    for (const [id, said] of this.said) {
      const block = this.workspace.getBlockById(id);
      if (!block) continue;
      const bubble = this.shown.get(id) ?? this.make(...said);
      this.shown.set(id, bubble);
      this.put(bubble, seenInPlaceOf(block));
    }
  }

  /** At the right of its block; where the page ends there, below or above it: whole, and large enough to read. */
  private put(bubble: Bubble, block: Blockly.BlockSvg): void {
    const scale = this.workspace.getAbsoluteScale();
    const grown = Math.max(1, LEAST_SCALE / scale);
    const width = bubble.width * grown;
    const height = bubble.height * grown;
    const view = this.seen();
    const at = block.getRelativeToSurfaceXY();
    const row = Math.min(block.height, ROW);
    const isInSight = at.x < view.right && at.x + block.width > view.left && at.y < view.bottom && at.y + row > view.top;
    // Not in part below the toolbox or its blocks, where its sentence is cut off.
    bubble.group.style.visibility = isInSight ? '' : 'hidden';
    const kept = (value: number, least: number, most: number) => isInSight ? Math.max(least, Math.min(most, value)) : value;
    const beside = at.x + block.width + GAP;
    const fits = beside + width + EDGE <= view.right || !isInSight;
    const x = fits ? kept(beside, view.left + EDGE, Infinity) :
      kept(at.x + GAP, view.left + EDGE, view.right - width - EDGE);
    const below = at.y + row + GAP;
    const roomBelow = below + height + EDGE <= view.bottom;
    const y = fits ? at.y + 4 : roomBelow ? below : at.y - GAP - height;
    const tip: Tip = fits ? 'left' : roomBelow ? 'top' : 'bottom';
    if (bubble.tip !== tip) bubble.frame.setAttribute('d', bubblePath(bubble.width, bubble.height, bubble.tip = tip));
    const top = kept(y, view.top + EDGE, view.bottom - height - EDGE);
    bubble.group.setAttribute('transform', `translate(${x}, ${top}) scale(${grown})`);
  }

  /** What of the workspace can be seen, without what the toolbox and its blocks cover. */
  private seen(): Blockly.utils.Rect {
    const scale = this.workspace.getAbsoluteScale();
    const view = this.workspace.getMetricsManager().getViewMetrics(true);
    const page = this.workspace.getParentSvg().getBoundingClientRect();
    const flyout = this.workspace.getFlyout();
    const svg = flyout?.isVisible() ? flyout.getWorkspace().getParentSvg().getBoundingClientRect() : null;
    const toolbox = this.workspace.getMetricsManager().getToolboxMetrics().width;
    const covered = svg ? Math.max(0, svg.right - page.left - toolbox) / scale : 0;
    const left = view.left + Math.min(covered, view.width / 2);
    return new Blockly.utils.Rect(view.top, view.top + view.height, left, view.left + view.width - BAR / scale);
  }

  private make(kind: BubbleKind, sentence: string): Bubble {
    const group = document.createElementNS(SVG, 'g');
    group.setAttribute('class', `nepBubble nepBubble-${kind}`);
    group.setAttribute('role', kind === 'error' ? 'alert' : 'status');
    group.dataset['said'] = `${kind} ${sentence}`;
    const frame = document.createElementNS(SVG, 'path');
    const icon = document.createElementNS(SVG, 'g');
    drawIcon(icon, ICONS[kind], 20);
    icon.setAttribute('transform', 'translate(12, 10)');
    const room = document.createElementNS(SVG, 'foreignObject');
    const words = document.createElement('div');
    words.className = 'nepBubbleText';
    words.textContent = sentence;
    room.append(words);
    group.append(frame, icon, room);
    this.workspace.getBubbleCanvas().append(group);
    const put = (attribute: string, value: number) => room.setAttribute(attribute, String(value));
    put('x', 40);
    put('y', 10);
    put('width', BUBBLE_WIDTH - 52);
    put('height', 400);
    const scale = this.workspace.getAbsoluteScale();
    const box = words.getBoundingClientRect();
    const width = Math.ceil(box.width / scale) + 56;
    const height = Math.max(20, Math.ceil(box.height / scale)) + 20;
    put('height', height - 18);
    put('width', width - 50);
    return {group, frame, width, height, tip: ''};
  }
}

/** A rounded box with a small tip: at its left, or near its left corner above or below. */
function bubblePath(width: number, height: number, tip: Tip): string {
  const w = width - 16;
  const h = height - 16;
  const top = tip === 'top' ? `h8l8-8 8 8h${w - 24}` : `h${w}`;
  const bottom = tip === 'bottom' ? `h${-(w - 24)}l-8 8-8-8h-8` : `h${-w}`;
  const left = tip === 'left' ? `v${-(h - 16)}l-8-8 8-8` : `v${-h}`;
  return `M8 0${top}a8 8 0 0 1 8 8v${h}a8 8 0 0 1-8 8${bottom}a8 8 0 0 1-8-8${left}a8 8 0 0 1 8-8z`;
}
