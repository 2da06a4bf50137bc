// What the service says, in the language of the page: its English text, or Chinese made of code and values.
import { CODES, ENGLISH, WORDS } from './codes';
import { prefs, t, word } from './prefs.svelte';
import type { Reply } from './protocol';
import type { AlarmRow, Message, Values } from './tables';

/** Fields that hold a word of the service: the group that it is of. */
const GROUPS: Record<string, string> = { role: 'role', action: 'action', mode: 'mode', wanted: 'mode' };

/** The messages of one text, or that text where the page is English or a message is not known. */
export function said(messages: Message[] | null | undefined, english: string | null | undefined): string {
  if (prefs.language !== 'zh' || !messages?.length) return english ?? '';
  const found = messages.map(inChinese);
  return found.includes('') ? (english ?? '') : found.join('，');
}

/** What became of a command: the text of its reply, or of the page where there is none. */
export function answered(reply: Pick<Reply, 'code' | 'text' | 'values'>): string {
  if (reply.text === 'off') return t('no_connection');
  if (reply.text === 'silent') return t('no_answer');
  return said([reply], reply.text);
}

/** The same with its code, which `gantryctl explain` and the journal know. */
export function coded(reply: Pick<Reply, 'code' | 'text' | 'values'>): string {
  return reply.code ? `${reply.code} · ${answered(reply)}` : answered(reply);
}

/** A message that the page itself has made: with its code, and in the words of the service. */
export function made(message: Message): string {
  return prefs.language === 'zh' ? inChinese(message) : inEnglish(message);
}

/** Title, cause or what to do of a code. */
export function ofCode(row: AlarmRow, part: 'title' | 'cause' | 'to_do'): string {
  return (prefs.language === 'zh' && CODES[row.code]?.[part]) || row[part];
}

/** English of one message of the page; it makes no others than `ENGLISH` has. */
function inEnglish(message: Message): string {
  if (typeof message === 'string') return message;
  const name = 'code' in message ? message.code : 'words' in message ? message.words : message.reason;
  return filled(ENGLISH[name], message.values, inEnglish);
}

/** Chinese of one message; empty when the page does not know it. */
function inChinese(message: Message): string {
  if (typeof message === 'string') return message;
  if ('words' in message) return filled(WORDS[message.words], message.values);
  const code = 'code' in message ? message.code : message.reason;
  const text = filled(CODES[code]?.message, message.values);
  return 'code' in message || text === '' ? text : `${code} · ${text} · ${CODES[code]?.to_do}`;
}

/** `{limit:+.2f}` stands for a number with sign and decimals, `{name}` for whatever the value is; empty where a value
 *  is missing: a reply that is too long comes without. */
function filled(template = '', values: Values, nested = inChinese): string {
  if ([...template.matchAll(/\{(\w+)/g)].some(([, name]) => values[name as string] === undefined)) return '';
  return template.replace(/\{(\w+)(?::(\+?)(?:\.(\d+))?([fg]))?\}/g, (_, name, sign, digits, kind) => {
    const value = values[name as string] ?? '';
    const group = GROUPS[name as string];
    if (group && typeof value === 'string') return word(group, value);
    if (Array.isArray(value)) return value.map(nested).join('；');
    if (typeof value !== 'number') return nested(value);
    const text =
      kind === 'f'
        ? value.toFixed(Number(digits))
        : String(kind === 'g' ? Number(value.toPrecision(Number(digits ?? 6))) : value);
    return sign && value >= 0 ? `+${text}` : text;
  });
}
