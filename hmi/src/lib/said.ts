// What the service says, in the language of the page. It says everything in English; Chinese comes from its own table.
import { prefs } from './prefs.svelte';
import { PHRASES } from './phrases';

const NUMBER = String.raw`[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|nan|inf)`;
const CODE = String.raw`[A-Z]{3}-\d+`;
const FIELD = /\{(\w+)(:[^}]*)?\}/g;
const KEPT = 300;

const plain = new Map<string, string>();
const templates: { english: RegExp; chinese: string }[] = [];
const known = new Map<string, string>();
for (const [english, chinese] of Object.entries(PHRASES)) {
  if (english.includes('{')) templates.push({ english: pattern(english), chinese });
  else plain.set(english.toLowerCase(), chinese);
}

/** A template as a pattern: `{limit:.2f}` matches a number, `{code}` a code, `{name}` any words. */
function pattern(template: string): RegExp {
  const escaped = template.replace(/[.*+?^$()|[\]\\]/g, String.raw`\$&`);
  const fields = escaped.replace(
    FIELD,
    (_, name: string, digits?: string) => `(?<${name}>${digits ? NUMBER : name === 'code' ? CODE : '.+?'})`,
  );
  return new RegExp(`^${fields}$`, 'i');
}

/** A sentence of the service in the language of the page; what the table does not have stays English. */
export function said(text: string | null | undefined): string {
  if (!text || prefs.language !== 'zh') return text ?? '';
  const found = known.get(text) ?? inChinese(text);
  if (known.size > KEPT) known.clear();
  known.set(text, found);
  return found;
}

function inChinese(text: string): string {
  const whole = plain.get(text.toLowerCase()) ?? filled(text);
  if (whole !== undefined) return whole;
  for (const [mark, chinese] of [
    [' · ', ' · '],
    [', ', '，'],
  ] as const) {
    if (text.includes(mark)) return text.split(mark).map(inChinese).join(chinese);
  }
  return text;
}

function filled(text: string): string | undefined {
  for (const { english, chinese } of templates) {
    const fields = english.exec(text)?.groups;
    if (fields) return chinese.replace(FIELD, (_, name: string) => inChinese(fields[name] ?? ''));
  }
  return undefined;
}
