// Drop-downs with options from outside (robots, topics), which keep a value that isn't among the options.
import * as Blockly from 'blockly/core';
import {t} from './words';

export type Option = [string, string];

/** Latest options of each source, such as "topics" or "robots:pepper". */
const sources = new Map<string, Option[]>();

export function isOption(value: unknown): value is Option {
  return Array.isArray(value) && typeof value[0] === 'string' && typeof value[1] === 'string';
}

/** Stores a source's options. Returns true if they have changed. */
export function setSource(source: string, options: Option[]): boolean {
  if (JSON.stringify(sources.get(source)) === JSON.stringify(options)) return false;
  sources.set(source, options);
  return true;
}

export interface ChoiceConfig extends Blockly.FieldConfig {
  options?: unknown[];
  source?: string;
  value?: string;
  topic?: string;
  text?: string;
  /** Name of the block's topic field; the choice is then a field of that topic's messages. */
  of?: string;
}

/** Prompts for values that can be typed: the label of the last option, and the question. */
const PROMPTS = {
  topic: {other: () => t('Other topic…'), name: () => t('Topic name')},
  field: {other: () => t('Other field…'), name: () => t('Field name')},
  message: {other: () => t('New message…'), name: () => t('Message name')},
};

const OTHER_VALUE = '\u0000other';

export class FieldChoice extends Blockly.FieldDropdown {
  private readonly staticOptions: Option[];
  private readonly source: string;
  /** Current value, kept as an option even if the source doesn't offer it. */
  private retainedValue: string | null = null;

  /** `typed` is the kind of value that can be typed instead of selected, or "". */
  constructor(config: ChoiceConfig, private readonly typed: keyof typeof PROMPTS | '' = '') {
    super(Blockly.Field.SKIP_SETUP);
    this.staticOptions = (config.options ?? []).filter(isOption);
    this.source = config.source ?? (typed === 'topic' ? 'topics' : '');
    const value = config.value ?? config.topic ?? config.text;
    if (value !== undefined) this.retainedValue = value;
    this.setOptions(() => this.createOptions());
    if (value !== undefined) this.setValue(value);
    this.configure_(config);
  }

  /** Returns the options offered at the moment. */
  protected availableOptions(): Option[] {
    return (this.source && sources.get(this.source)) || this.staticOptions;
  }

  /** Returns the default text of the prompt, which can be accepted without a keyboard. */
  protected promptDefault(): string {
    return this.value_ ?? '';
  }

  /** Returns the current options; never empty, always including the current value. */
  private createOptions(): Option[] {
    const options: Option[] = [...this.availableOptions()];
    const value = this.retainedValue;
    if (value !== null && !options.some((option) => option[1] === value)) options.push([value, value]);
    if (this.typed) options.push([PROMPTS[this.typed].other(), OTHER_VALUE]);
    return options.length ? options : [['–', '']];
  }

  /** Rereads the source; the value stays, its label may change. */
  refresh(): void {
    const before = this.getText();
    this.getOptions(false);
    if (this.value_ !== null) this.doValueUpdate_(this.value_);
    if (this.getText() !== before && this.getSourceBlock()) this.forceRerender();
  }

  override setOptions(options: Blockly.MenuGenerator): void {
    this.menuGenerator_ = options;
    const first = this.getOptions(false)[0];
    if (Array.isArray(first)) this.setValue(first[1] === OTHER_VALUE ? '' : first[1]);
  }

  protected override doClassValidation_(value?: unknown): string | null {
    return typeof value === 'string' && value !== OTHER_VALUE ? value : null;
  }

  protected override doValueUpdate_(value: string): void {
    this.retainedValue = value;
    this.getOptions(false);
    super.doValueUpdate_(value);
  }

  protected override onItemSelected_(menu: Blockly.Menu, item: Blockly.MenuItem): void {
    if (item.getValue() !== OTHER_VALUE) {
      super.onItemSelected_(menu, item);
      return;
    }
    Blockly.dialog.prompt(PROMPTS[this.typed || 'topic'].name(), this.promptDefault(), (text) => {
      const name = text?.trim().replace(/\s+/g, ' ');
      if (name) this.setValue(name);
    });
    document.querySelector<HTMLInputElement>('.blocklyDialogInput')?.select();
  }

  static override fromJson(config: Blockly.FieldConfig): FieldChoice {
    return new FieldChoice(config as ChoiceConfig);
  }
}

/** Drop-down of topic names or of message fields; other names can be typed. */
export class FieldTopic extends FieldChoice {
  constructor(config: ChoiceConfig) {
    super(config, config.of === undefined ? 'topic' : 'field');
  }

  static override fromJson(config: Blockly.FieldConfig): FieldTopic {
    return new FieldTopic(config as ChoiceConfig);
  }
}

/** Drop-down of messages between scripts: names used by blocks, or a new one. */
export class FieldBroadcast extends FieldChoice {
  private static readonly types = ['events_received', 'events_broadcast', 'events_broadcast_wait'];

  constructor(config: ChoiceConfig) {
    super(config, 'message');
  }

  protected override availableOptions(): Option[] {
    const workspace = this.getSourceBlock()?.workspace as Blockly.WorkspaceSvg | undefined;
    const main = workspace?.targetWorkspace ?? workspace;
    const blocks = FieldBroadcast.types.flatMap((type) => main?.getBlocksByType(type, false) ?? []);
    const names = new Set(blocks.map((block) => String(block.getFieldValue('NAME') ?? '')));
    return [...names].filter(Boolean).sort((one, other) => one.localeCompare(other)).map((name) => [name, name]);
  }

  /** Returns the first unused name of “message 1”, “message 2” and so on. */
  protected override promptDefault(): string {
    const usedNames = new Set(this.availableOptions().map(([, name]) => name));
    let number = 1;
    while (usedNames.has(t('message {number}', {number}))) number += 1;
    return t('message {number}', {number});
  }

  static override fromJson(config: Blockly.FieldConfig): FieldBroadcast {
    return new FieldBroadcast(config as ChoiceConfig);
  }
}

Blockly.fieldRegistry.register('field_broadcast', FieldBroadcast);
Blockly.fieldRegistry.register('field_choice', FieldChoice);
Blockly.fieldRegistry.register('field_topic', FieldTopic);
