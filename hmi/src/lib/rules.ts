// Why a command is not offered now. The service decides; this only spares the person a refusal.
import type { Key } from './en';
import { link } from './link.svelte';
import { RIGHTS, type Action } from './tables';

const CONTROLLED = new Set(RIGHTS.filter((right) => right.control).map((right) => right.action));

/** The text that says why not, or empty. `more` are further conditions, the first that fails counts. */
export function whyNot(action: Action, more: [boolean, Key][] = []): Key | '' {
  if (link.stale) return 'why_stale';
  if (!link.may(action)) return 'why_role';
  if (CONTROLLED.has(action) && !link.mine) return 'why_control';
  return more.find(([fails]) => fails)?.[1] ?? '';
}

/** Conditions of every motion. */
export function motion(): [boolean, Key][] {
  const { power, alarms, journal_state } = link.tags;
  return [
    [alarms?.some((row) => row.severity === 'STOP') ?? false, 'why_alarm'],
    [power !== true, 'why_power'],
    [journal_state !== 'ok' && journal_state !== 'slow', 'why_journal'],
  ];
}

/** Mode and speed conditions of the keys and of increments. */
export function keys(mode: 'continuous' | 'incremental'): [boolean, Key][] {
  const {
    speed_setting_deg_s: speed,
    speed_cap_deg_s: cap,
    override_percent: override,
    enabling_switch,
  } = link.tags;
  const fast = speed != null && cap != null && (speed * (override ?? 100)) / 100 > cap + 1e-9;
  const wrong: Key = mode === 'continuous' ? 'why_continuous' : 'why_incremental';
  return [...motion(), [link.tags.mode !== mode, wrong], [fast && enabling_switch !== true, 'why_cap']];
}
