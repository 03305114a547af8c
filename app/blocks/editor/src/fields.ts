// Custom fields: icon, button, live value, colour.
import * as Blockly from 'blockly/core';
import {drawIcon, iconName} from './icons';
import {lazy, t} from './words';

const SVG_NS = 'http://www.w3.org/2000/svg';
const BUTTON_SIZE = 24;
const BLANK_IMAGE = 'data:image/gif;base64,R0lGODlhAQABAAAAACwAAAAAAQABAAA=';

interface IconConfig extends Blockly.FieldConfig {
  name?: string;
  icon?: string;
  size?: number;
  alt?: string;
}

/** Lucide icon in white; the category's icon if the name is unknown. */
export class FieldIcon extends Blockly.FieldImage {
  constructor(private readonly icon: string, private readonly side: number, alt: string) {
    super(BLANK_IMAGE, side, side, alt);
  }

  override initView(): void {
    if (!this.fieldGroup_) return;
    this.fieldGroup_.classList.add('nepIcon');
    this.fieldGroup_.setAttribute('aria-hidden', 'true');
    const block = this.getSourceBlock();
    drawIcon(this.fieldGroup_, iconName(this.icon, block?.getStyleName() ?? ''), this.side);
  }

  protected override doValueUpdate_(value: string): void {
    this.value_ = value;
  }

  /** Returns no label, because the block's text already describes it. */
  override computeAriaLabel(): string {
    return '';
  }

  static override fromJson(config: Blockly.FieldConfig): FieldIcon {
    const {icon, name, size, alt} = config as IconConfig;
    return new FieldIcon(icon ?? name ?? '', size ?? 20, alt ?? '');
  }
}

/** A small round button on a block, such as “+”. */
export class FieldButton extends Blockly.FieldImage {
  constructor(private readonly icon: string, label: string, action: () => void) {
    super(BLANK_IMAGE, BUTTON_SIZE, BUTTON_SIZE, label, action);
    this.setTooltip(label);
  }

  /** Makes the button part of the block in the flyout: a block can be changed after it was dragged out. */
  override isClickableInFlyout(): boolean {
    return false;
  }

  override initView(): void {
    if (!this.fieldGroup_) return;
    this.fieldGroup_.classList.add('nepButton');
    const ring = document.createElementNS(SVG_NS, 'circle');
    for (const [name, value] of Object.entries({cx: BUTTON_SIZE / 2, cy: BUTTON_SIZE / 2, r: BUTTON_SIZE / 2})) {
      ring.setAttribute(name, String(value));
    }
    const glyph = document.createElementNS(SVG_NS, 'g');
    glyph.setAttribute('transform', 'translate(4, 4)');
    const inner = document.createElementNS(SVG_NS, 'g');
    drawIcon(inner, this.icon, BUTTON_SIZE - 8);
    glyph.append(inner);
    this.fieldGroup_.append(ring, glyph);
    this.recomputeAriaContext();
  }

  protected override doValueUpdate_(value: string): void {
    this.value_ = value;
  }
}

/** Live value of a sensor ("84 %"), set by the window; neither saved nor undoable. */
export class FieldLive extends Blockly.FieldLabel {
  override SERIALIZABLE = false;

  /** Shows the text without firing an event; free if the text is the same, cheap if its width is. */
  show(text: string, isOutdated = false): void {
    this.fieldGroup_?.classList.toggle('nepOld', isOutdated);
    if (text === this.value_) return;
    const normalizeDigits = (value: string) => value.replace(/\d/g, '0');
    const hasSameWidth = normalizeDigits(text) === normalizeDigits(String(this.value_ ?? ''));  // all digits have the same width
    this.value_ = text;
    if (hasSameWidth && this.textContent_) this.textContent_.nodeValue = this.getDisplayText_();
    else this.forceRerender();
  }

  override initView(): void {
    super.initView();
    this.fieldGroup_?.classList.add('nepLive');
  }

  static override fromJson(_config: Blockly.FieldConfig): FieldLive {
    return new FieldLive('');
  }
}

interface ColourConfig extends Blockly.FieldConfig {
  value?: string;
  colour?: string;
  text?: string;
}

const PALETTE: readonly [string, string][] = [
  [lazy('white'), '#ffffff'], [lazy('red'), '#ff3b30'], [lazy('orange'), '#ff9500'], [lazy('yellow'), '#ffd60a'],
  [lazy('green'), '#34c759'], [lazy('cyan'), '#3db8ff'], [lazy('blue'), '#0a5cff'], [lazy('purple'), '#af52de'],
  [lazy('pink'), '#ff5fa2'], [lazy('off'), '#000000'],
];
const COLUMNS = 5;
const CHIP_SIZE = {width: 39, height: 23};

/** Returns the name of the palette colour nearest to this one. */
function nearestColourName(colour: string): string {
  const parts = (hex: string) => [1, 3, 5].map((start) => parseInt(hex.slice(start, start + 2), 16));
  const target = parts(colour);
  const distance = ([, hex]: readonly [string, string]) =>
    parts(hex).reduce((sum, value, index) => sum + (value - (target[index] ?? 0)) ** 2, 0);
  return PALETTE.reduce((best, other) => (distance(other) < distance(best) ? other : best))[0];
}

/** Colour field "#rrggbb", shown as a chip; a click opens a small palette with an input for any other colour. */
export class FieldColourChip extends Blockly.Field {
  override SERIALIZABLE = true;
  override EDITABLE = true;
  private chip: SVGRectElement | null = null;

  constructor(value: string) {
    super(Blockly.Field.SKIP_SETUP);
    this.setValue(value);
    if (!this.value_) this.value_ = '#ffffff';
  }

  protected override initView(): void {
    this.size_ = new Blockly.utils.Size(CHIP_SIZE.width, CHIP_SIZE.height);
    this.fieldGroup_?.classList.add('nepColour');
    this.chip = document.createElementNS(SVG_NS, 'rect');
    this.chip.setAttribute('class', 'nepChip');
    for (const [name, value] of Object.entries({x: 1, y: 1, width: CHIP_SIZE.width - 2, height: CHIP_SIZE.height - 2, rx: 10.5})) {
      this.chip.setAttribute(name, String(value));
    }
    this.fieldGroup_?.append(this.chip);
    this.clickTarget_ = this.fieldGroup_;
    this.recomputeAriaContext();
  }

  override getAriaTypeName(): string {
    return 'colour';
  }

  override getAriaValue(): string {
    const text = this.getText();
    return text.startsWith('#') ? `like ${nearestColourName(text)}` : text;
  }

  protected override updateSize_(): void {
    this.size_ = new Blockly.utils.Size(CHIP_SIZE.width, CHIP_SIZE.height);
  }

  protected override render_(): void {
    this.updateSize_();
    this.chip?.setAttribute('style', `fill:${this.value_ ?? ''}`);
    this.recomputeAriaContext();
  }

  /** Returns the bounds of the chip, to which the palette points; the default is the whole block. */
  override getScaledBBox(): Blockly.utils.Rect {
    const box = (this.chip ?? document.body).getBoundingClientRect();
    return new Blockly.utils.Rect(box.top, box.bottom, box.left, box.right);
  }

  protected override doClassValidation_(value?: unknown): string | null {
    return typeof value === 'string' && /^#[0-9a-f]{6}$/i.test(value) ? value.toLowerCase() : null;
  }

  protected override getText_(): string {
    const paletteEntry = PALETTE.find(([, value]) => value === this.value_);
    return paletteEntry ? t(paletteEntry[0]) : this.value_ ?? '';
  }

  protected override showEditor_(): void {
    Blockly.DropDownDiv.clearContent();
    const content = Blockly.DropDownDiv.getContentDiv();
    const box = document.createElement('div');
    box.className = 'nepPalette';
    box.setAttribute('role', 'group');
    for (const [name, value] of PALETTE) {
      const swatch = document.createElement('button');
      swatch.type = 'button';
      swatch.title = t(name);
      swatch.setAttribute('aria-label', t(name));
      swatch.setAttribute('aria-pressed', String(value === this.value_));
      swatch.style.background = value;
      swatch.onclick = () => this.choose(value);
      box.append(swatch);
    }
    const other = document.createElement('input');
    other.value = this.value_ ?? '';
    other.spellcheck = false;
    other.maxLength = 7;
    other.setAttribute('aria-label', t('Another colour: # and six hexadecimal digits'));
    other.oninput = () => other.classList.toggle('wrong', this.doClassValidation_(other.value) === null);
    other.onkeydown = (event) => {
      if (event.key === 'Enter' && this.doClassValidation_(other.value) !== null) this.choose(other.value);
    };
    box.append(other);
    box.onkeydown = (event) => this.onPaletteKey(event, box);
    content.append(box);
    Blockly.DropDownDiv.setColour('var(--nep-raised)', 'var(--nep-borderStrong)');
    Blockly.DropDownDiv.showPositionedByField(this);
    (box.querySelector('[aria-pressed=true]') as HTMLElement | null ?? other).focus();
  }

  /** Handles the arrow keys (between colours), Tab (to the input and back) and Escape (closes without a change). */
  private onPaletteKey(event: KeyboardEvent, box: HTMLElement): void {
    event.stopPropagation();
    const swatches = [...box.querySelectorAll('button')];
    const other = box.querySelector('input');
    const index = swatches.indexOf(document.activeElement as HTMLButtonElement);
    const by = {ArrowRight: 1, ArrowLeft: -1, ArrowDown: COLUMNS, ArrowUp: -COLUMNS}[event.key];
    if (event.key === 'Escape') Blockly.DropDownDiv.hideIfOwner(this, true);
    else if (event.key === 'Tab') (index < 0 ? swatches[0] : other)?.focus();
    else if (by !== undefined && index >= 0) swatches[(index + by + swatches.length) % swatches.length]?.focus();
    else return;
    event.preventDefault();
  }

  private choose(value: string): void {
    this.setValue(value);
    Blockly.DropDownDiv.hideIfOwner(this, true);
  }

  static override fromJson(config: Blockly.FieldConfig): FieldColourChip {
    const {value, colour, text} = config as ColourConfig;
    return new FieldColourChip(value ?? colour ?? text ?? '#ffffff');
  }
}

Blockly.fieldRegistry.register('field_icon', FieldIcon);
Blockly.fieldRegistry.register('field_live', FieldLive);
Blockly.fieldRegistry.register('field_colour_chip', FieldColourChip);
