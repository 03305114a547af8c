// Drop-downs whose options come from outside (robots, topics) and which never drop a value they do not know.
import * as Blockly from 'blockly/core';
import {t} from './words';

export type Option = [string, string];

/** The newest options of each source: "topics", "robots:pepper". */
const sources = new Map<string, Option[]>();

export function isOption(value: unknown): value is Option {
  return Array.isArray(value) && typeof value[0] === 'string' && typeof value[1] === 'string';
}

/** Remembers a source's options. True if they are new. */
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
  /** The field of a message (of the topic in that field), not a topic. */
  of?: string;
}

/** What people may type: the words of the last option, and those of the question. */
const PROMPTS = {
  topic: {other: () => t('Other topic…'), name: () => t('Topic name')},
  field: {other: () => t('Other field…'), name: () => t('Field name')},
  message: {other: () => t('New message…'), name: () => t('Message name')},
};

const OTHER_VALUE = '\u0000other';

export class FieldChoice extends Blockly.FieldDropdown {
  private readonly staticOptions: Option[];
  private readonly source: string;
  /** The value the block has although no option offers it. */
  private retainedValue: string | null = null;

  /** `typed`: what a person may type instead of choosing, or "". */
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

  /** What is known to choose from now. */
  protected availableOptions(): Option[] {
    return (this.source && sources.get(this.source)) || this.staticOptions;
  }

  /** What stands in the question for another one: it can be taken as it is, without a keyboard. */
  protected promptDefault(): string {
    return this.value_ ?? '';
  }

  /** Present options, always with the present value among them and never empty. */
  private createOptions(): Option[] {
    const options: Option[] = [...this.availableOptions()];
    const value = this.retainedValue;
    if (value !== null && !options.some((option) => option[1] === value)) options.push([value, value]);
    if (this.typed) options.push([PROMPTS[this.typed].other(), OTHER_VALUE]);
    return options.length ? options : [['–', '']];
  }

  /** Reads the source again; the value stays, its label may change. */
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

/** The name of a topic (or of a message's field): one that is known now, or any other that is typed. */
export class FieldTopic extends FieldChoice {
  constructor(config: ChoiceConfig) {
    super(config, config.of === undefined ? 'topic' : 'field');
  }

  static override fromJson(config: Blockly.FieldConfig): FieldTopic {
    return new FieldTopic(config as ChoiceConfig);
  }
}

/** The name of a message that scripts send each other: one that a block has already, or a new one. */
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

  /** The first of “message 1”, “message 2” and so on that no block has. */
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
