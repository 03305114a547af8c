// Sentences beside blocks: what failed, what a person is warned of.
import * as Blockly from 'blockly/core';
import {seenInPlaceOf} from './folding';
import {drawIcon} from './icons';

export type BubbleKind = 'error' | 'warning';
export type Said = readonly [kind: BubbleKind, sentence: string];

const SVG = 'http://www.w3.org/2000/svg';
const BUBBLE_WIDTH = 300;
const GAP = 14;
const ICONS: Readonly<Record<BubbleKind, string>> = {error: 'circle-x', warning: 'triangle-alert'};

/** One bubble a block, at its right, in block units so that it scales with the workspace. */
export class Bubbles {
  private said: ReadonlyMap<string, Said> = new Map();
  private readonly shown = new Map<string, SVGGElement>();
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
      if (this.said.get(id)?.join(' ') !== bubble.dataset['said'] || !this.workspace.getBlockById(id)) {
        bubble.remove();
        this.shown.delete(id);
      }
    }
    for (const [id, said] of this.said) {
      const block = this.workspace.getBlockById(id);
      if (!block) continue;
      const bubble = this.shown.get(id) ?? this.make(...said);
      this.shown.set(id, bubble);
      const seen = seenInPlaceOf(block);
      const at = seen.getRelativeToSurfaceXY();
      bubble.setAttribute('transform', `translate(${at.x + seen.width + GAP}, ${at.y + 4})`);
    }
  }

  private make(kind: BubbleKind, sentence: string): SVGGElement {
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
    frame.setAttribute('d', bubblePath(width, height));
    return group;
  }
}

/** A rounded box with a small tip at its left. */
function bubblePath(width: number, height: number): string {
  const w = width - 16;
  const h = height - 16;
  return `M8 0h${w}a8 8 0 0 1 8 8v${h}a8 8 0 0 1-8 8h-${w}a8 8 0 0 1-8-8v${-(h - 16)}l-8-8 8-8a8 8 0 0 1 8-8z`;
}
