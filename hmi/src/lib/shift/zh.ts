// 报警声音、值班记录、人员和帮助的中文文本。
import type { en } from './en';

export const zh: Record<keyof typeof en, string> = {
  sound: '报警声音',
  sound_off: '关',
  sound_on: '开',
  sound_blocked: '报警声音已开，但在您按键或点击本页之前浏览器保持静音。',
  shift_log: '值班记录',
  shift_line: '值班记录的一行',
  shift_write: '写入',
  here_now: '现在在此',
  has_control: '持有控制权',
  place_remote: '远程屏幕',
  control_local: '{user} 在本地控制台持有控制权。',
  why_no_text: '请输入一行。',
  help: '帮助',
  help_key: '帮助 (F1)',
  help_close: '关闭',
  help_keys: '按键',
};
