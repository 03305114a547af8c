// Zelos, plus the outlines that say what a block is doing (UI.md §4 "Block states").
import * as Blockly from 'blockly/core';

export type BlockState = 'running' | 'stopped' | 'error';

const SVG = 'http://www.w3.org/2000/svg';
/** Widths of the strokes that together make the soft glow; cheaper than a blur, repainted ten times a second. */
const GLOW_WIDTHS = [19, 15, 11, 7];

/** A block's shape that can carry one outline above everything inside the block. */
export class StatePath extends Blockly.zelos.PathObject {
  private state: BlockState | null = null;
  private marks: SVGGElement[] = [];

  override setPath(path: string): void {
    super.setPath(path);
    for (const mark of this.marks) mark.querySelectorAll('path').forEach((each) => each.setAttribute('d', path));
  }

  /** Shows one state, or none; calling it again with the same state costs nothing. */
  setState(state: BlockState | null): void {
    if (state === this.state) return;
    this.state = state;
    for (const mark of this.marks) mark.remove();
    this.marks = [];
    if (!state) return;
    // The outline lies on everything inside the block, the glow behind the block itself.
    const outline = this.mark(`nepState nepState-${state}`, 'nepOutline', [state === 'running' ? 4 : 3]);
    this.svgRoot.append(outline);
    if (state === 'running') this.svgRoot.prepend(this.mark('nepState nepGlow', 'nepGlowRing', GLOW_WIDTHS));
  }

  private mark(name: string, pathName: string, widths: number[]): SVGGElement {
    const group = document.createElementNS(SVG, 'g');
    group.setAttribute('class', name);
    group.setAttribute('aria-hidden', 'true');
    group.append(...widths.map((width) => this.copy(pathName, width)));
    this.marks.push(group);
    return group;
  }

  private copy(name: string, width: number): SVGPathElement {
    const path = document.createElementNS(SVG, 'path');
    path.setAttribute('class', name);
    path.setAttribute('d', this.svgPath.getAttribute('d') ?? '');
    path.setAttribute('stroke-width', String(width));
    return path;
  }
}

class Constants extends Blockly.zelos.ConstantProvider {
  override FIELD_TEXT_FONTWEIGHT = '600';
}

class Renderer extends Blockly.zelos.Renderer {
  protected override makeConstants_(): Blockly.zelos.ConstantProvider {
    return new Constants();
  }

  override makePathObject(root: SVGElement, style: Blockly.Theme.BlockStyle): StatePath {
    return new StatePath(root, style, this.getConstants());
  }
}

export const RENDERER = 'nep';
Blockly.blockRendering.register(RENDERER, Renderer);

/** The outline carrier of a rendered block. */
export function pathOf(block: Blockly.BlockSvg): StatePath | null {
  return block.pathObject instanceof StatePath ? block.pathObject : null;
}
