// Number field that accepts comma and point as decimal separators (Blockly's removes commas: 0,2 becomes 2) and
// rejects invalid text with a message; the field then keptValueText its value.
import * as Blockly from 'blockly/core';
import {Hint} from './hint';
import {parseNumber, type Rejection} from './typed_number';
import {lazy, t} from './words';

const REJECTION_MESSAGES: Readonly<Record<Rejection, string>> = {
  'separators': lazy('Enter a number with at most one decimal comma or point, such as 1234.5 or 1234,5.'),
  'not a number': lazy('Enter a number.'),
};
/** Start of a number, for which no message is shown yet. */
const UNFINISHED = /^\s*[+\u2212-]?[.,]?\s*$/;

class NumberField extends Blockly.FieldNumber {
  private problem: Rejection | null = null;

  protected override doClassValidation_(value?: unknown): number | null {
    const number = typeof value === 'string' ? parseNumber(value) : value;
    return typeof number === 'number' && Number.isFinite(number) ? super.doClassValidation_(number) : null;
  }

  protected override doValueInvalid_(value: unknown, fireChangeEvent = true): void {
    super.doValueInvalid_(value, fireChangeEvent);
    if (!this.isBeingEdited_) return;
    const typed = String(value);
    const problem = parseNumber(typed);
    this.problem = typeof problem === 'string' ? problem : null;
    if (this.problem && !UNFINISHED.test(typed)) this.showHint(t(REJECTION_MESSAGES[this.problem]));
    else this.hint?.hide();
  }

  protected override doValueUpdate_(value: number): void {
    super.doValueUpdate_(value);
    if (this.isBeingEdited_ && this.problem) this.hint?.hide();
    this.problem = null;
  }

  override onFinishEditing_(value: unknown): void {
    super.onFinishEditing_(value);
    const keptValueText = t('The value stays {number}.', {number: String(value)});
    if (this.problem) this.showHint(`${t(REJECTION_MESSAGES[this.problem])} ${keptValueText}`);
    this.problem = null;
  }

  private get hint(): Hint | null {
    return Hint.of(this.getSourceBlock()?.workspace);
  }

  private showHint(text: string): void {
    const {left, bottom} = this.getScaledBBox();
    this.hint?.show(text, new Blockly.utils.Coordinate(left, bottom));
  }
}

Blockly.fieldRegistry.unregister('field_number');
Blockly.fieldRegistry.register('field_number', NumberField);
