import { mount } from 'svelte';
import './css/all.css';
import App from './App.svelte';

const target = document.getElementById('app');
if (target === null) throw new Error('no #app in the page');
mount(App, { target });
