// Language and theme: of this browser only, never of the machine.
import { en, type Key } from './en';
import { zh } from './zh';

export type Language = 'en' | 'zh';
export type Theme = 'auto' | 'light' | 'dark';
const DARK = matchMedia('(prefers-color-scheme: dark)');

function kept<T extends string>(name: string, allowed: readonly T[], otherwise: T): T {
  const found = localStorage.getItem(`gantryctl.${name}`) as T | null;
  return found !== null && allowed.includes(found) ? found : otherwise;
}

class Prefs {
  language = $state<Language>(
    kept('language', ['en', 'zh'], navigator.language.startsWith('zh') ? 'zh' : 'en'),
  );
  theme = $state<Theme>(kept('theme', ['auto', 'light', 'dark'], 'auto'));
  #system = $state(DARK.matches);
  dark = $derived(this.theme === 'dark' || (this.theme === 'auto' && this.#system));

  constructor() {
    DARK.addEventListener('change', (event) => (this.#system = event.matches));
  }

  /** Put it in force, and keep it. */
  apply(): void {
    document.documentElement.lang = this.language === 'zh' ? 'zh-CN' : 'en';
    document.documentElement.dataset.theme = this.dark ? 'dark' : 'light';
    localStorage.setItem('gantryctl.language', this.language);
    localStorage.setItem('gantryctl.theme', this.theme);
  }
}

export const prefs = new Prefs();

/** A text in the language of the page; `{name}` is filled in. */
export function t(key: Key, values: Record<string, string | number> = {}): string {
  const text = (prefs.language === 'zh' ? zh : en)[key];
  return text.replace(/\{(\w+)\}/g, (_, name: string) => String(values[name] ?? ''));
}

/** Date and time of the place, from UTC; what is no time stays as it is. */
export function clock(at: string): string {
  const when = new Date(at);
  return Number.isNaN(when.getTime()) ? at : when.toLocaleString(place());
}

/** The time of day alone, with so many decimals of its seconds. */
export function timeOfDay(seconds: number, decimals: 0 | 1 | 2 | 3 = 0): string {
  const parts = { hour: '2-digit', minute: '2-digit', second: '2-digit', hour12: false } as const;
  const fraction = decimals === 0 ? {} : { fractionalSecondDigits: decimals };
  return new Date(1000 * seconds).toLocaleTimeString(place(), { ...parts, ...fraction });
}

/** The date alone. */
export function day(at: string): string {
  const when = new Date(at);
  return Number.isNaN(when.getTime()) ? at : when.toLocaleDateString(place());
}

function place(): string {
  return prefs.language === 'zh' ? 'zh-CN' : 'en-GB';
}

/** The word for a value that comes from the service: an enum, a role, an action. */
export function word(group: string, value: string | null | undefined): string {
  if (value == null) return t('unknown');
  const key = `${group}_${value}`;
  return key in en ? t(key as Key) : value.replaceAll('_', ' ');
}
