// Zelos renderer with outlines for the states of a block.
import * as Blockly from 'blockly/core';

export type BlockState = 'running' | 'stopped' | 'error';

type Shape = [path: string, offset: Blockly.utils.Coordinate, rtl: boolean];

const SVG_NS = 'http://www.w3.org/2000/svg';
/** Delay before a running block glows: 30 glows per second of short blocks cost half a CPU core. */
const GLOW_DELAY_MS = 150;
/** Widths of the stacked strokes of a glow, which is cheaper to repaint than a blur. */
const GLOW_WIDTHS = [19, 15, 11, 7];

/** Path object that can draw an outline above all children of the block. */
export class StatePath extends Blockly.zelos.PathObject {
  private state: BlockState | null = null;
  private marks: SVGGElement[] = [];
  private glowTimer = 0;
  /** Connection highlights that aren't drawn yet; drawn on demand because they are a fifth of all SVG elements. */
  private readonly undrawn = new Map<Blockly.RenderedConnection, Shape>();

  override addConnectionHighlight(connection: Blockly.RenderedConnection, ...shape: Shape): SVGElement {
    if (connection.isHighlighted() || this.drawn.has(connection)) return this.draw(connection, shape);
    this.undrawn.set(connection, shape);
    return undefined as unknown as SVGElement;  // callers check for undefined
  }

  override removeConnectionHighlight(connection: Blockly.RenderedConnection): void {
    this.undrawn.delete(connection);
    this.drawn.delete(connection);
    super.removeConnectionHighlight(connection);
  }

  /** Draws the highlight of a connection when it gets the focus or a dragged block is near. */
  drawConnection(connection: Blockly.RenderedConnection): void {
    const shape = this.undrawn.get(connection);
    if (shape) connection.setAriaRole(this.draw(connection, shape));
  }

  private readonly drawn = new Set<Blockly.RenderedConnection>();

  private draw(connection: Blockly.RenderedConnection, shape: Shape): SVGElement {
    this.undrawn.delete(connection);
    this.drawn.add(connection);
    return super.addConnectionHighlight(connection, ...shape);
  }

  /** Style name of the surrounding block, '' if there is none. Blocks of one stack share it. */
  private surroundingStyle = '';
  private selection: SVGGElement | null = null;
  private isSelected = false;
  private isMultiSelected = false;

  override applyColour(block: Blockly.BlockSvg): void {
    super.applyColour(block);
    const parent = block.getParent();
    const above = parent && pathOf(parent);
    const surroundingStyle = !parent ? '' : parent.getNextBlock() === block ? above?.surroundingStyle ?? '' : parent.getStyleName();
    // Only the parent of the first block in a stack changes; the blocks below move with it.
    let next: Blockly.BlockSvg | null = block;
    for (let path: StatePath | null = this; next && path; next = next.getNextBlock(), path = next && pathOf(next)) {
      if (next !== block && path.surroundingStyle === surroundingStyle) break;
      path.setSurroundingStyle(surroundingStyle, next);
    }
  }

  /** Sets the surrounding style; a block inside one of the same style gets a light edge. */
  private setSurroundingStyle(surroundingStyle: string, block: Blockly.BlockSvg): void {
    this.surroundingStyle = surroundingStyle;
    this.setClass_('nepInside', surroundingStyle !== '' && !block.isShadow() && surroundingStyle === block.getStyleName());
  }

  /** Draws the selection outline in two tones: one contrasts with every block, the other with every canvas. */
  override updateSelected(enable: boolean): void {
    this.setClass_('blocklySelected', enable);
    this.isSelected = enable;
    this.updateOutline();
  }

  /** Marks the block as one of several selected blocks, with or without the focus. */
  setMultiSelected(isMultiSelected: boolean): void {
    this.setClass_('nepChosen', isMultiSelected);
    this.isMultiSelected = isMultiSelected;
    this.updateOutline();
  }

  private updateOutline(): void {
    const isOutlined = this.isSelected || this.isMultiSelected;
    if (isOutlined === (this.selection !== null)) return;
    this.selection?.remove();
    this.selection = isOutlined ? this.createGroup('nepSelection', 'nepSelected', [7, 3]) : null;
    if (this.selection) this.svgRoot.append(this.selection);
  }

  override setPath(path: string): void {
    super.setPath(path);
    this.selection?.querySelectorAll('path').forEach((element) => element.setAttribute('d', path));
    for (const mark of this.marks) mark.querySelectorAll('path').forEach((element) => element.setAttribute('d', path));
  }

  /** Shows a state, or none; does nothing if the state is unchanged. */
  setState(state: BlockState | null): void {
    if (state === this.state) return;
    this.state = state;
    window.clearTimeout(this.glowTimer);
    for (const mark of this.marks) mark.remove();
    this.marks = [];
    if (!state) return;
    // The outline is drawn above the children of the block, the glow behind the block.
    const outline = this.addMark(`nepState nepState-${state}`, 'nepOutline', [state === 'running' ? 4 : 3]);
    this.svgRoot.append(outline);
    if (state === 'running') this.glowTimer = window.setTimeout(() => this.addGlow(), GLOW_DELAY_MS);
  }

  private addGlow(): void {
    this.svgRoot.prepend(this.addMark('nepState nepGlow', 'nepGlowRing', GLOW_WIDTHS));
  }

  private addMark(name: string, pathName: string, widths: number[]): SVGGElement {
    const group = this.createGroup(name, pathName, widths);
    this.marks.push(group);
    return group;
  }

  private createGroup(name: string, pathName: string, widths: number[]): SVGGElement {
    const group = document.createElementNS(SVG_NS, 'g');
    group.setAttribute('class', name);
    group.setAttribute('aria-hidden', 'true');
    group.append(...widths.map((width) => this.createPath(pathName, width)));
    return group;
  }

  private createPath(name: string, width: number): SVGPathElement {
    const path = document.createElementNS(SVG_NS, 'path');
    path.setAttribute('class', name);
    path.setAttribute('d', this.svgPath.getAttribute('d') ?? '');
    path.setAttribute('stroke-width', String(width));
    return path;
  }
}

class Constants extends Blockly.zelos.ConstantProvider {
  override FIELD_TEXT_FONTWEIGHT = '600';
  private defaultStyle: Blockly.Theme.BlockStyle | null = null;

  /** Caches the default style: every new block requests it, and Blockly computes it each time. */
  override getBlockStyle(name: string | null): Blockly.Theme.BlockStyle {
    return name ? super.getBlockStyle(name) : this.defaultStyle ??= super.getBlockStyle(name);
  }
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

/** Returns the path object of a rendered block. */
export function pathOf(block: Blockly.BlockSvg): StatePath | null {
  return block.pathObject instanceof StatePath ? block.pathObject : null;
}

/** Enter on a value block with a single field opens that field's editor directly. */
const basePerformAction = Blockly.BlockSvg.prototype.performAction;
Blockly.BlockSvg.prototype.performAction = function (this: Blockly.BlockSvg, event?: KeyboardEvent) {
  const fields = [...this.getFields()].filter((field) => field.isClickable());
  const [only] = fields;
  if (!this.workspace.isFlyout && this.outputConnection && fields.length === 1 && only) only.showEditor(event);
  else basePerformAction.call(this, event);
};

/** Private method of Blockly that finds the SVG element of a connection highlight. */
interface HighlightFinder {
  findHighlightSvg(this: Blockly.RenderedConnection): SVGPathElement | null;
}
const connectionPrototype = Blockly.RenderedConnection.prototype as unknown as HighlightFinder;
const baseFindHighlightSvg = connectionPrototype.findHighlightSvg;
connectionPrototype.findHighlightSvg = function (this: Blockly.RenderedConnection) {
  pathOf(this.getSourceBlock())?.drawConnection(this);
  return baseFindHighlightSvg.call(this);
};
