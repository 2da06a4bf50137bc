// Words of which the contrary would do harm, in both languages: each is tested by what must stand in it and what must not.
import { expect, test } from 'vitest';
import { en } from '../src/lib/en';
import { zh } from '../src/lib/zh';

const WORDS: [keyof typeof en, has: [RegExp, RegExp], not: [RegExp, RegExp]][] = [
  ['open', [/open/, /松开/], [/closed/, /抱紧/]],
  ['closed', [/closed/, /抱紧/], [/open/, /松开/]],
  ['forward', [/Forward \+/, /正向 \+/], [/Rev|−/, /反|−/]],
  ['reverse', [/Reverse −/, /反向 −/], [/For|\+/, /正|\+/]],
  ['step_forward', [/^\+/, /^\+/], [/−/, /−/]],
  ['step_reverse', [/^−/, /^−/], [/\+/, /\+/]],
  ['direction_positive', [/^positive/, /^正/], [/negative/, /反/]],
  ['direction_negative', [/^negative/, /^反/], [/positive/, /正/]],
  ['travel_minus', [/−/, /负/], [/\+/, /正/]],
  ['travel_plus', [/\+/, /正/], [/−/, /负/]],
  ['limit_minus_ok', [/− free/, /负限位未触发/], [/\+/, /正/]],
  ['limit_plus_ok', [/\+ free/, /正限位未触发/], [/−/, /负/]],
  ['power_on', [/on$/, /^上电/], [/off/, /断/]],
  ['power_off', [/off$/, /^断电/], [/on$/, /上/]],
  ['take', [/^Take/, /^取得/], [/Give/, /交还/]],
  ['give', [/^Give/, /^交还/], [/Take/, /取得/]],
  ['stop_title', [/Not an emergency stop/, /不是急停/], [/reset needed/, /复位/]],
  ['quick_stop_title', [/reset needed.*Not an emergency stop/, /需要复位.*不是急停/], [/gently/, /平稳/]],
  ['reset_hint', [/never switches power on/, /绝不会上电/], [/then switches/, /后上电/]],
  ['no_connection', [/was not sent.*stop devices at the machine/, /未发送.*机器上的停止装置/], [/was sent/, /已发送/]],
  ['no_answer', [/No answer/, /没有应答/], [/not sent/, /未发送/]],
  ['stale_do', [/No motion can be started/, /不能启动任何运动/], [/Wait/, /等待/]],
  ['commission_still', [/Nothing moves/, /不产生运动/], [/Could/, /可能/]],
  ['commission_moves', [/Could move: \{moves\}.*everybody away/, /可能的运动：\{moves\}.*所有人都已离开/], [/Nothing/, /不产生/]],
  ['commission_holds', [/Torque alone.*the brake does not/, /仅靠电机转矩.*制动器不能保持/], [/brake holds/, /制动器保持/]],
  ['outcome_passed', [/^passed/, /^通过/], [/fail/, /未/]],
  ['outcome_failed', [/^failed/, /^未通过/], [/pass/, /^通过/]],
  ['result_passed', [/^passed/, /^通过/], [/FAIL/, /未/]],
  ['result_failed', [/^FAILED/, /^未通过/], [/pass/, /^通过/]],
  ['result_aborted', [/shows nothing/, /无结论/], [/pass/, /通过/]],
  ['test_stop', [/brake stays closed/, /制动器保持抱紧/], [/open/, /松开/]],
  ['brake_overdue', [/OVERDUE/, /已过期/], [/not/, /未/]],
  ['why_second', [/Another person/, /另一人/], [/You/, /您/]],
  ['why_same_person', [/You armed.*another person must execute/, /您已预备.*另一人执行/], [/first/, /先/]],
  ['why_power_off_first', [/off first/, /先断电/], [/on first/, /先上电/]],
  ['why_power', [/Power is off/, /动力未接通/], [/is on/, /已接通/]],
  ['why_is_on', [/Power is on/, /动力已接通/], [/is off/, /未接通/]],
  ['estop_ok', [/chain closed/, /回路闭合/], [/open/, /断开/]],
  ['door_ok', [/door closed/, /门关闭/], [/open/, /打开/]],
  ['collision_ok', [/No collision/, /无碰撞/], [/^Coll/, /^碰撞/]],
  ['position_valid', [/trusted/, /可信/], [/not/, /不/]],
  ['not_blocked', [/can be switched on/, /可以上电/], [/cannot/, /不/]],
  ['why_blocked', [/cannot be switched on/, /不能上电/], [/can be/, /可以/]],
  ['locked', [/only the service role/, /只有维修角色/], [/operator/, /操作员/]],
  ['power_phase_torque_hold', [/brake is not trusted/, /制动器不可信/], [/brake holds/, /制动器保持/]],
  ['power_phase_parked', [/on the brake/, /制动器保持/], [/motor/, /电机/]],
  ['power_phase_on', [/^on$/, /^接通$/], [/off/, /断/]],
  ['power_phase_off', [/^off$/, /^断开$/], [/on/, /接通/]],
  ['axis_state_disabled', [/off/, /断开/], [/on$/, /接通/]],
]; // prettier-ignore

test.each(WORDS)('%s does not say the contrary', (key, [english, chinese], [notEnglish, notChinese]) => {
  expect(en[key]).toMatch(english);
  expect(en[key]).not.toMatch(notEnglish);
  expect(zh[key]).toMatch(chinese);
  expect(zh[key]).not.toMatch(notChinese);
});

test('both languages have the same values to fill in, and the same figures', () => {
  const parts = (text: string): string[] =>
    [...text.matchAll(/\{\w+\}|\d+(?:\.\d+)?/g)].map(([part]) => part).sort();
  for (const key of Object.keys(en) as (keyof typeof en)[])
    expect([key, parts(zh[key])]).toEqual([key, parts(en[key])]);
});
