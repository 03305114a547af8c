// Message bubbles beside blocks: errors and warnings.
import * as Blockly from 'blockly/core';
import {visibleBlockOf} from './folding';
import {drawIcon} from './icons';

export type BubbleKind = 'error' | 'warning';
export type BubbleContent = readonly [kind: BubbleKind, sentence: string];

const SVG_NS = 'http://www.w3.org/2000/svg';
const BUBBLE_WIDTH = 300;
const GAP = 14;
const VIEW_MARGIN = 8;
/** Height of a block's first row: the bubble of a tall block is placed next to it. */
const FIRST_ROW_HEIGHT = 64;
/** Width of the scrollbar, in pixels of the page. */
const SCROLLBAR_WIDTH = 15;
/** Workspace scale below which bubbles stop shrinking. */
const MIN_SCALE = 0.8;

type TipSide = 'left' | 'top' | 'bottom';

interface Bubble {
  group: SVGGElement;
  frame: SVGPathElement;
  width: number;
  height: number;
  tip: TipSide | '';
}
const ICONS: Readonly<Record<BubbleKind, string>> = {error: 'circle-x', warning: 'triangle-alert'};

/** One bubble per block, beside the block and fully in view; scales with the workspace down to a readable size. */
export class Bubbles {
  private contents: ReadonlyMap<string, BubbleContent> = new Map();
  private readonly bubbles = new Map<string, Bubble>();
  private placing = 0;

  constructor(private readonly workspace: Blockly.WorkspaceSvg) {}

  /** Replaces all bubbles; keys are block ids. */
  setContents(contents: ReadonlyMap<string, BubbleContent>): void {
    this.contents = contents;
    this.update();
  }

  /** Schedules an update after blocks moved or changed; does nothing without bubbles. */
  scheduleUpdate(): void {
    if (this.placing || !(this.contents.size || this.bubbles.size)) return;
    this.placing = window.requestAnimationFrame(() => {
      this.placing = 0;
      this.update();
    });
  }

  private update(): void {
    for (const [id, bubble] of this.bubbles) {
      if (this.contents.get(id)?.join(' ') !== bubble.group.dataset['said'] || !this.workspace.getBlockById(id)) {
        bubble.group.remove();
        this.bubbles.delete(id);
      }
    }
    for (const [id, said] of this.contents) {
      const block = this.workspace.getBlockById(id);
      if (!block) continue;
      const bubble = this.bubbles.get(id) ?? this.createBubble(...said);
      this.bubbles.set(id, bubble);
      this.positionBubble(bubble, visibleBlockOf(block));
    }
  }

  /** Positions a bubble to the right of its block, or below or above the block if there is no space. */
  private positionBubble(bubble: Bubble, block: Blockly.BlockSvg): void {
    const scale = this.workspace.getAbsoluteScale();
    const scaleFactor = Math.max(1, MIN_SCALE / scale);
    const width = bubble.width * scaleFactor;
    const height = bubble.height * scaleFactor;
    const view = this.visibleRect();
    const position = block.getRelativeToSurfaceXY();
    const row = Math.min(block.height, FIRST_ROW_HEIGHT);
    const isInSight = position.x < view.right && position.x + block.width > view.left && position.y < view.bottom && position.y + row > view.top;
    // Hidden if its block is covered by the toolbox or flyout, which would cut the text off.
    bubble.group.style.visibility = isInSight ? '' : 'hidden';
    const clamp = (value: number, min: number, max: number) => isInSight ? Math.max(min, Math.min(max, value)) : value;
    const rightX = position.x + block.width + GAP;
    const fitsRight = rightX + width + VIEW_MARGIN <= view.right || !isInSight;
    const x = fitsRight ? clamp(rightX, view.left + VIEW_MARGIN, Infinity) :
      clamp(position.x + GAP, view.left + VIEW_MARGIN, view.right - width - VIEW_MARGIN);
    const below = position.y + row + GAP;
    const roomBelow = below + height + VIEW_MARGIN <= view.bottom;
    const y = fitsRight ? position.y + 4 : roomBelow ? below : position.y - GAP - height;
    const tip: TipSide = fitsRight ? 'left' : roomBelow ? 'top' : 'bottom';
    if (bubble.tip !== tip) bubble.frame.setAttribute('d', bubblePath(bubble.width, bubble.height, bubble.tip = tip));
    const top = clamp(y, view.top + VIEW_MARGIN, view.bottom - height - VIEW_MARGIN);
    bubble.group.setAttribute('transform', `translate(${x}, ${top}) scale(${scaleFactor})`);
  }

  /** Returns the visible part of the workspace, without the area under the toolbox and flyout. */
  private visibleRect(): Blockly.utils.Rect {
    const scale = this.workspace.getAbsoluteScale();
    const view = this.workspace.getMetricsManager().getViewMetrics(true);
    const page = this.workspace.getParentSvg().getBoundingClientRect();
    const flyout = this.workspace.getFlyout();
    const svg = flyout?.isVisible() ? flyout.getWorkspace().getParentSvg().getBoundingClientRect() : null;
    const toolbox = this.workspace.getMetricsManager().getToolboxMetrics().width;
    const covered = svg ? Math.max(0, svg.right - page.left - toolbox) / scale : 0;
    const left = view.left + Math.min(covered, view.width / 2);
    return new Blockly.utils.Rect(view.top, view.top + view.height, left, view.left + view.width - SCROLLBAR_WIDTH / scale);
  }

  private createBubble(kind: BubbleKind, text: string): Bubble {
    const group = document.createElementNS(SVG_NS, 'g');
    group.setAttribute('class', `nepBubble nepBubble-${kind}`);
    group.setAttribute('role', kind === 'error' ? 'alert' : 'status');
    group.dataset['said'] = `${kind} ${text}`;
    const frame = document.createElementNS(SVG_NS, 'path');
    const icon = document.createElementNS(SVG_NS, 'g');
    drawIcon(icon, ICONS[kind], 20);
    icon.setAttribute('transform', 'translate(12, 10)');
    const room = document.createElementNS(SVG_NS, 'foreignObject');
    const textElement = document.createElement('div');
    textElement.className = 'nepBubbleText';
    textElement.textContent = text;
    room.append(textElement);
    group.append(frame, icon, room);
    this.workspace.getBubbleCanvas().append(group);
    const setAttribute = (attribute: string, value: number) => room.setAttribute(attribute, String(value));
    setAttribute('x', 40);
    setAttribute('y', 10);
    setAttribute('width', BUBBLE_WIDTH - 52);
    setAttribute('height', 400);
    const scale = this.workspace.getAbsoluteScale();
    const box = textElement.getBoundingClientRect();
    const width = Math.ceil(box.width / scale) + 56;
    const height = Math.max(20, Math.ceil(box.height / scale)) + 20;
    setAttribute('height', height - 18);
    setAttribute('width', width - 50);
    return {group, frame, width, height, tip: ''};
  }
}

/** Returns the path of a rounded box with a tip at the left, or near the left corner at the top or bottom. */
function bubblePath(width: number, height: number, tip: TipSide): string {
  const w = width - 16;
  const h = height - 16;
  const top = tip === 'top' ? `h8l8-8 8 8h${w - 24}` : `h${w}`;
  const bottom = tip === 'bottom' ? `h${-(w - 24)}l-8 8-8-8h-8` : `h${-w}`;
  const left = tip === 'left' ? `v${-(h - 16)}l-8-8 8-8` : `v${-h}`;
  return `M8 0${top}a8 8 0 0 1 8 8v${h}a8 8 0 0 1-8 8${bottom}a8 8 0 0 1-8-8${left}a8 8 0 0 1 8-8z`;
}
