#include "reports/page_parts.h"

namespace evac {
namespace {

// Colours: Okabe & Ito's, darkened or lightened to stand out from the ground. What colour says, shape or text says too.
constexpr const char* kColours = R"css(
:root{color-scheme:light dark;--ground:#fff;--raised:#f6f7f8;--ink:#1a1e23;--quiet:#59626d;--rule:#dcdfe4;--grid:#e7e9ed;
--c0:#0072b2;--c1:#c44e00;--c2:#00795a;--c3:#a8527f;--c4:#946200;--c5:#2b8cc4;--c6:#5a4fcf;--c7:#555;
--good:#00694d;--bad:#b04400;--other:#c44e00;--notice:#fff6e0;--notice-rule:#e0b64a}
@media(prefers-color-scheme:dark){:root{--ground:#14171b;--raised:#1c2026;--ink:#e7e9ec;--quiet:#9aa4af;--rule:#333942;--grid:#272c33;
--c0:#56b4e9;--c1:#f08a4b;--c2:#3cc29a;--c3:#d990b8;--c4:#e6a92e;--c5:#8fcdf0;--c6:#a9a2f5;--c7:#b5b5b5;
--good:#3cc29a;--bad:#f08a4b;--other:#f08a4b;--notice:#2b2412;--notice-rule:#7d6420}}
)css";

constexpr const char* kText = R"css(
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%;scroll-padding-top:2.55rem}
body{margin:0 auto;max-width:72rem;padding:2.2rem 1.5rem 4rem;background:var(--ground);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif;font-variant-numeric:tabular-nums;overflow-wrap:break-word}
h1{font-size:1.75rem;line-height:1.2;font-weight:650;letter-spacing:-.015em;margin:0}
h2{font-size:1.3rem;font-weight:650;letter-spacing:-.01em;margin:0 0 .4rem}
h3{font-size:1.02rem;font-weight:650;margin:1.4rem 0 .2rem}
h4{font-size:.95rem;font-weight:650;margin:0}h4 .quiet{font-weight:400}
h5{font-size:.87rem;font-weight:600;margin:0}
p{margin:.2rem 0}
.subtitle,.quiet{color:var(--quiet)}.quiet{font-size:.87rem;max-width:52rem}.subtitle{margin-top:.35rem}
section{margin-top:2.6rem;padding-top:1.4rem;border-top:1px solid var(--rule)}
a{color:var(--c0)}code,pre{font:.85em/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,"DejaVu Sans Mono",monospace}
code{overflow-wrap:anywhere}
pre{white-space:pre-wrap;overflow-wrap:anywhere;background:var(--raised);padding:.8rem 1rem;border-radius:6px;max-height:24rem;overflow:auto;margin:.4rem 0}
.sr{position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%);white-space:nowrap}
:focus-visible{outline:2px solid var(--c0);outline-offset:2px}
nav{position:sticky;top:0;z-index:2;display:flex;flex-wrap:wrap;gap:.1rem 1.2rem;background:var(--ground);padding:.6rem 0;margin-top:1.6rem;font-size:.9rem;border-bottom:1px solid var(--rule)}
nav a{color:var(--quiet);text-decoration:none}nav a:hover{color:var(--ink);text-decoration:underline}
nav + section{border-top:0;margin-top:1rem}
.notice{background:var(--notice);border:1px solid var(--notice-rule);border-radius:6px;padding:.7rem 1rem;margin:1.2rem 0}
.findings{border:0;padding:0;margin-top:1.5rem}
.findings dl{margin:0;display:grid;gap:.9rem}
.findings dt{font-size:.87rem;color:var(--quiet);padding-left:7.2rem}
.findings dd{margin:.05rem 0 0;display:grid;grid-template-columns:6.2rem minmax(0,1fr);gap:1rem;align-items:start;font-size:1.05rem;line-height:1.45;max-width:62rem}.findings dd p{margin:0}
.tag{justify-self:start;margin-top:.16rem;font-size:.76rem;font-weight:650;line-height:1.3;padding:.08rem .5rem;border-radius:99px;border:1.5px solid var(--quiet);color:var(--quiet);white-space:nowrap}
.tag.yes{background:var(--good);border-color:var(--good);color:var(--ground)}
.tag.no{background:var(--bad);border-color:var(--bad);color:var(--ground)}
.tag.not-decided{border-style:dashed}
.outcome{font-weight:600;white-space:nowrap}.outcome.success{color:var(--good)}.outcome.failure{color:var(--bad)}
.outcome.error,.outcome.invalid,.outcome.cannot_tell,.outcome.unjudged{color:var(--quiet)}
)css";

constexpr const char* kTablesAndCharts = R"css(
table{border-collapse:collapse;text-align:left}th{font-weight:400}thead th{color:var(--quiet);font-size:.82rem;font-weight:400}
.num{text-align:right;white-space:nowrap}small{display:block;font-size:.8rem;color:var(--quiet);line-height:1.3}
.tasks{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,29rem),1fr));gap:1rem 3rem}
.rates{width:100%;table-layout:auto;font-size:.9rem;margin-top:.5rem}
.rates td,.rates th{padding:0 .45rem;height:24px;line-height:24px;white-space:nowrap}
.rates th[scope=row],.rates thead th:first-child{padding-left:0;width:1%;color:var(--quiet)}
.rates .group th{padding:.55rem 0 .05rem;height:auto;font-weight:600;line-height:1.5;white-space:normal}
.rates .plot{width:99%;padding:0 .9rem}.rates .rate{min-width:8.2rem}.rates .apart{font-size:.74rem;color:var(--quiet);padding-right:0;width:1%;min-width:5.4rem;white-space:normal;line-height:12px}.aside{display:none}
.none{opacity:.5}.num .why{white-space:normal;min-width:6rem}.ci{white-space:nowrap}.stats+.quiet{margin:.6rem 0 1rem}
.strip{display:block;width:100%;overflow:visible}.strip .grid{stroke:var(--grid)}.scale text{font-size:11px;fill:var(--quiet)}
.icon{vertical-align:-3px;margin-right:.25rem;overflow:visible}
.range{stroke-width:1.8;stroke:currentColor}.dot{stroke-width:2;stroke:currentColor;fill:var(--ground)}
.w0{color:var(--ink)}.w1{color:var(--other)}.w2{color:var(--c0)}.w3{color:var(--c2)}.w0 .dot,.dot.w0{fill:currentColor}
.comparison{display:grid;grid-template-columns:minmax(0,1fr) minmax(0,1fr);gap:1rem 2.5rem;align-items:start;margin-top:.6rem}
.comparison figure{margin:0}figcaption{font-size:.87rem;color:var(--quiet)}
.scatter{display:block;width:100%;max-width:34rem;height:auto}.scatter text{font-size:12.5px;fill:var(--quiet)}
.scatter .axis{fill:var(--ink)}.scatter .letter{font-weight:650;font-size:13px;fill:var(--ink);paint-order:stroke;stroke:var(--ground);stroke-width:3px;stroke-linejoin:round}
.frame{fill:none;stroke:var(--rule)}.scatter .grid{stroke:var(--grid)}.identity{stroke:var(--quiet);stroke-dasharray:5 4;fill:none}
.whisker{fill:none;stroke:currentColor;stroke-width:1.3;opacity:.55}.mark{stroke:currentColor;stroke-width:1.8;fill:currentColor}
.p0{color:var(--c0)}.p1{color:var(--c1)}.p2{color:var(--c2)}.p3{color:var(--c3)}.p4{color:var(--c4)}.p5{color:var(--c5)}.p6{color:var(--c6)}.p7{color:var(--c7)}
.t1{fill:var(--ground)}.t2{fill-opacity:.45}.t3{fill:var(--ground);stroke-dasharray:2.2 1.6}
.stats,.points{width:100%;font-size:.9rem}.stats td,.stats th,.points td,.points th{padding:.32rem .5rem;border-bottom:1px solid var(--rule);vertical-align:top}
.stats th:first-child,.points th:first-child{padding-left:0}.stats .big{font-size:1.1rem;font-weight:650}.points{margin-top:1rem}
.points .key{white-space:nowrap;padding-left:0;width:1%}.points .quiet{font-size:inherit;margin-left:.4rem}.points .key b{display:inline-block;min-width:1.1em}
.plain{font-size:.88rem;margin:.4rem 0}.plain td,.plain th{padding:.3rem .8rem .3rem 0;border-bottom:1px solid var(--rule);vertical-align:top;overflow-wrap:anywhere}
.plain td.num,.plain th.num{overflow-wrap:normal;padding-left:.8rem}.wide{overflow-x:auto}
)css";

constexpr const char* kEpisodes = R"css(
.cards{margin-top:.8rem;display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,29rem),1fr));gap:1rem}
.card{border:1px solid var(--rule);border-radius:8px;padding:.9rem 1rem;min-width:0}.card:has(details[open]){grid-column:1/-1}
.overview{display:flex;gap:1.3rem;align-items:center;margin-top:.6rem}.overview p{font-size:.87rem;color:var(--quiet);margin:0;min-width:0}.card>.states{margin-top:.5rem}
.two{font-size:.85rem;flex:none}.two th{color:var(--quiet);padding:0 .45rem;font-size:.8rem;white-space:nowrap;max-width:6rem;overflow:hidden;text-overflow:ellipsis}
.two thead th{padding-bottom:.2rem}.two tbody th{padding-left:0}
.two tbody td{border:1px solid var(--rule);text-align:center;min-width:2.7rem;height:1.8rem}.two .off{font-weight:650;background:var(--raised)}
.states{display:flex;flex-wrap:wrap;gap:3px;list-style:none;padding:0;margin:0}.states a{display:block;padding:1px;border-radius:3px;text-decoration:none}
.states a.flip{outline:2px solid var(--other);outline-offset:0}
.states i{display:block;width:13px;height:12px;border:1.5px solid var(--ink)}.states a i+i{border-top:0}
.states .yes{background:var(--ink)}.states .out{border-style:dotted;background:repeating-linear-gradient(135deg,transparent 0 2px,var(--quiet) 2px 3px)}
.states.key{display:inline-block;vertical-align:-1px}
details{margin-top:.7rem}summary{cursor:pointer;font-size:.9rem}
.pairs{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,30rem),1fr));gap:1.2rem 1.6rem;margin-top:.8rem}
.pair{display:grid;grid-template-columns:1fr auto;gap:.4rem .6rem;align-items:center;min-width:0}.pair:target{outline:2px solid var(--other);outline-offset:6px;border-radius:2px}
.sides{grid-column:1/-1;display:grid;grid-template-columns:minmax(0,1fr) minmax(0,1fr);gap:.7rem}.sides figure{margin:0;min-width:0}.sides figcaption{margin-top:.3rem;color:var(--ink);line-height:1.35}
button,select{font:inherit;font-size:.85rem;color:var(--ink);background:var(--raised);border:1px solid var(--rule);border-radius:6px;padding:.2rem .7rem}button{cursor:pointer}
video,.play img{display:block;width:100%;height:auto;background:#000;border-radius:4px;image-rendering:auto}
.novideo{display:grid;place-items:center;aspect-ratio:2;background:var(--raised);border:1px dashed var(--rule);border-radius:4px;color:var(--quiet);font-size:.87rem;margin:0}
.stages{display:flex;flex-wrap:wrap;gap:0 .7rem;list-style:none;padding:0;margin:.1rem 0;font-size:.83rem}.stages .yes{color:var(--good)}.stages .no{color:var(--bad)}
.filters{display:flex;flex-wrap:wrap;gap:.6rem 1rem;align-items:end;margin:.6rem 0 1rem}.filters[hidden],[hidden]{display:none!important}
.filters label{display:grid;gap:.15rem;font-size:.8rem;color:var(--quiet)}.filters select{max-width:13rem}.filters output{font-size:.87rem;color:var(--quiet);padding-bottom:.25rem}
.clips{display:grid;grid-template-columns:repeat(auto-fill,minmax(11rem,1fr));gap:1.1rem .9rem}
.more{margin-top:1.2rem}.clip{margin:0;min-width:0;content-visibility:auto;contain-intrinsic-size:auto 11rem}.clip figcaption{font-size:.8rem;line-height:1.35;margin-top:.3rem;color:var(--ink)}.clip p{margin:0}.clip .quiet{font-size:.8rem}
.clip:target{outline:2px solid var(--c0);outline-offset:4px;border-radius:2px}
.facts{margin:.6rem 0}.facts>div{display:grid;grid-template-columns:9rem minmax(0,1fr);gap:.2rem 1rem;padding:.55rem 0;border-bottom:1px solid var(--rule)}
.facts dt{color:var(--quiet)}.facts dd{margin:0;min-width:0;font-size:.92rem}.folded{margin:.1rem 0}
)css";

constexpr const char* kSmallAndPrint = R"css(
@media(max-width:760px){.comparison{grid-template-columns:minmax(0,1fr)}}
@media(max-width:560px){body{padding:1.3rem 1rem 3rem;font-size:14.5px}h1{font-size:1.45rem}section{margin-top:1.9rem;padding-top:1.1rem}
nav{gap:.1rem .7rem;font-size:.8rem}html{scroll-padding-top:2.35rem}
.findings dt{padding-left:0}.findings dd{grid-template-columns:minmax(0,1fr);gap:.25rem}.tag{justify-self:start}.findings dl{gap:1.1rem}
.rates{font-size:.82rem}.rates td,.rates th{padding:0 .25rem}.rates .plot{padding:0 .6rem}.rates .apart{display:none}.aside{display:block;margin-top:-.25rem;padding-bottom:.2rem}
.points .quiet{display:block;margin:0;font-size:.78rem}
.stats td,.stats th,.points td,.points th{padding:.3rem .3rem}.stats,.points{font-size:.83rem}.ci{display:block}.points th{overflow-wrap:anywhere}.overview{flex-direction:column;align-items:flex-start;gap:.6rem}.sides{grid-template-columns:minmax(0,1fr)}.num small{font-size:.74rem}.rates .rate{min-width:0}
.clips{grid-template-columns:repeat(auto-fill,minmax(8.6rem,1fr));gap:.9rem .7rem}
.facts>div{grid-template-columns:minmax(0,1fr)}.filters label{flex:1 1 40%}.filters select{max-width:none;width:100%}}
@media print{nav,.filters,button{display:none!important}body{max-width:none;padding:0}.card,.clip,figure{break-inside:avoid}}
)css";

}  // namespace

std::string PageStyle() { return std::string(kColours) + kText + kTablesAndCharts + kEpisodes + kSmallAndPrint; }

}  // namespace evac
