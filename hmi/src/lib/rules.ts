// Why a command is not offered now. The service decides; this only spares the person a refusal.
import type { Key } from './en';
import { link } from './link.svelte';
import { sight } from './sight.svelte';
import { RIGHTS, type Action } from './tables';

/** What moves the axis, or lets it move. */
const STARTS = new Set<Action>(['power', 'mode', 'jog', 'move', 'brake_test', 'commission']);
const CONTROLLED = new Set(RIGHTS.filter((right) => right.control).map((right) => right.action));

/** The text that says why not, or empty. `more` are further conditions, the first that fails counts. */
export function whyNot(
  action: Action,
  more: [boolean, Key][] = [],
  control = CONTROLLED.has(action),
): Key | '' {
  if (link.stale) return 'why_stale';
  if (!link.may(action)) return 'why_role';
  if (control && !link.mine) return 'why_control';
  if (STARTS.has(action) && !sight.stop) return 'why_no_stop';
  return more.find(([fails]) => fails)?.[1] ?? '';
}

/** Whatever is to begin must be kept in the journal. */
export function journal(): [boolean, Key] {
  const { journal_state } = link.tags;
  return [journal_state !== 'ok' && journal_state !== 'slow', 'why_journal'];
}

/** Conditions of every motion. */
export function motion(): [boolean, Key][] {
  const { power, alarms, brake_test_overdue: overdue } = link.tags;
  return [
    [alarms?.some((row) => row.severity === 'STOP') ?? false, 'why_alarm'],
    [power !== true, 'why_power'],
    journal(),
    [overdue === true && fast(), 'why_overdue'],
  ];
}

/** Faster than is allowed without the enabling switch, and without a brake test in time. The speed setting counts,
 *  as in the service; the override can be raised at any moment. */
function fast(): boolean {
  const { speed_setting_deg_s: speed, speed_cap_deg_s: cap } = link.tags;
  return speed != null && cap != null && speed > cap + 1e-9;
}

/** Of an axis whose slowest setting is faster still, no lower speed helps. */
function capped(counts = true): [boolean, Key] {
  const { speed_min_deg_s: slowest, speed_cap_deg_s: cap, enabling_switch } = link.tags;
  const always = slowest != null && cap != null && slowest > cap + 1e-9;
  return [counts && fast() && enabling_switch !== true, always ? 'why_cap_always' : 'why_cap'];
}

/** A motion of the set-point that can be ended: a stop that an alarm has begun takes its own course. */
export function halting(): [boolean, Key][] {
  const { at_rest, axis_state } = link.tags;
  return [
    [axis_state === 'error_stop', 'why_alarm'],
    [at_rest === true, 'why_at_rest'],
  ];
}

/** Conditions of a move to an angle: from a remote screen the cap holds as it does for the keys. */
export function move(): [boolean, Key][] {
  return [...motion(), capped(link.welcome?.place === 'remote')];
}

/** Mode and speed conditions of the keys and of increments. */
export function keys(mode: 'continuous' | 'incremental'): [boolean, Key][] {
  const wrong: Key = mode === 'continuous' ? 'why_continuous' : 'why_incremental';
  return [...motion(), [link.tags.mode !== mode, wrong], capped()];
}
