"""How the page looks on a screen, and on one sheet of A4."""

from __future__ import annotations

from boltpose.report.markup import Html

STYLE = Html("""
*{box-sizing:border-box;margin:0;padding:0}
html{-webkit-text-size-adjust:100%}
body{font:14px/1.35 system-ui,"Segoe UI","Liberation Sans","DejaVu Sans",Arial,sans-serif;
color:#111;background:#fff;-webkit-print-color-adjust:exact;print-color-adjust:exact}
main{max-width:1280px;margin:0 auto;padding:12px}
main>*{margin-bottom:10px}
.icon{width:1.15em;height:1.15em;vertical-align:-.22em;flex:none}
.verdict{display:flex;align-items:center;gap:16px;padding:10px 18px;color:#fff;
border-radius:6px;border:3px solid}
.verdict.ok{background:#14692f;border-color:#0b4a20}
.verdict.refused{background:#a80019;border-color:#6d0010}
.verdict .icon{width:68px;height:68px}
.verdict .word{flex:1 1 auto}
.verdict h1{font-size:50px;line-height:1;letter-spacing:.04em}
.verdict p{font-size:17px}
.verdict dl{flex:0 1 auto;max-width:46%;font-size:15px}
.verdict dl div{display:flex;gap:8px}
.verdict dt{min-width:6.6em;opacity:.9}
.verdict dd{font-weight:bold;overflow-wrap:anywhere}
.notice{display:flex;gap:10px;align-items:center;font-size:16px;padding:6px 12px;
background:#fff3b8;border:3px solid #111;border-left-width:12px;overflow-wrap:anywhere}
.notice .icon{width:30px;height:30px}
.notice strong{font-size:18px}
.danger{border-width:6px;border-left-width:12px;font-size:18px;
border-image:repeating-linear-gradient(45deg,#111 0 10px,#ffd400 10px 20px) 6 6 6 12}
.danger strong{font-size:24px}
.notice code{white-space:nowrap}
.verdict h1 small{font-size:24px;color:#fff;letter-spacing:0;font-weight:bold}
em{font-style:normal;color:#a80019}
h2{font-size:16px;border-bottom:2px solid #111;margin-bottom:3px}
h3{font-size:14px;margin-top:6px}
small{font-weight:normal;font-size:12px;color:#333}
.pictures{display:grid;gap:8px}
.pictures.p3{grid-template-columns:480fr 380fr 380fr}
.pictures.p2{grid-template-columns:480fr 380fr;max-width:900px}
.pictures.p1{max-width:620px}
figure{border:1px solid #888;min-width:0}
figure svg{display:block;width:100%;height:auto}
figcaption svg.sign{display:inline}
figure div>svg+svg{border-top:1px solid #888}
.beside{display:grid;grid-template-columns:1fr 1fr}
.beside>svg+svg{border-top:0;border-left:1px solid #888}
figcaption{border-top:1px solid #888;padding:2px 6px;font-size:13px}
.key{margin-left:10px;white-space:nowrap}
figure svg.sign{width:26px;height:12px;vertical-align:-1px}
svg text{font-family:inherit}
.label,.name{paint-order:stroke;stroke:#fff;stroke-width:3.2px;stroke-linejoin:round}
.label{font-size:13px;fill:#111}
.ribbon{font-size:17px;font-weight:bold;fill:#fff;stroke:none}
.name{font-size:17px;font-weight:bold}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{text-align:left;vertical-align:top;padding:2px 6px;overflow-wrap:anywhere}
thead th{font-size:12px;font-weight:normal;color:#333;border-bottom:1px solid #111;
vertical-align:bottom}
tbody th{font-weight:normal}
.n{text-align:right;white-space:nowrap}
thead .n{white-space:normal}
.bolts td,.bolts th{line-height:1.25}
.bolts tbody th{min-width:150px}
.bolts tbody{border-bottom:1px solid #ccc}
.bolts .word,.bolts thead th{white-space:nowrap}
.bolts .note{padding-top:0;padding-left:22px;font-size:13px}
.forbidden{color:#a80019;background:#fdeaea;outline:2px solid #a80019;outline-offset:-2px}
.forbidden s,.forbidden b{text-decoration:line-through;text-decoration-thickness:2px}
.unsure{background:#fff8d6}
.forbidden.unsure{background:#fdeaea}
.advice th{width:36%;font-weight:bold}
.advice th code{display:block;font-weight:normal;color:#444}
.advice td{font-size:15px}
.advice tr{border-bottom:1px solid #ccc}
.advice .first{background:#fdeaea}
.advice .first th,.advice .first td{font-size:18px;padding:5px 6px}
.refusal{border:3px solid #a80019;padding:8px 12px;border-radius:6px}
.found{padding-left:20px}
.foot{display:grid;gap:14px;grid-template-columns:1fr}
.columns{display:grid;gap:0 24px;grid-template-columns:1fr 1fr;align-items:start}
.bar{width:110px;height:13px;display:block;margin-top:2px}
.mid{text-align:center;width:118px}
.missed{font-weight:bold;background:#fdeaea}
.missed th{font-weight:bold}
.fine{font-size:12px;color:#333;margin-top:3px}
.facts dl>div{display:grid;grid-template-columns:8em 1fr;font-size:13px}
.facts dt{color:#333}
.facts dd{overflow-wrap:anywhere}
code{font-family:"Liberation Mono","DejaVu Sans Mono",Consolas,monospace;font-size:.92em}
footer{font-size:12px;color:#333}
@media screen and (max-width:760px){
.pictures.p3,.pictures.p2,.columns{grid-template-columns:1fr}
.verdict{flex-wrap:wrap}.verdict dl{max-width:100%}
section{overflow-x:auto}
}
@page{size:A4 portrait;margin:9mm}
@media print{
body{font-size:7.6pt;line-height:1.2}
main{max-width:none;padding:0}
main>*{margin-bottom:1.8mm}
.verdict{padding:1.4mm 3mm;gap:4mm;border-radius:1mm;break-inside:avoid}
.verdict .icon{width:14mm;height:14mm}
.verdict h1{font-size:25pt}
.verdict h1 small{font-size:13pt}
.verdict p{font-size:9.5pt}
.verdict dl{font-size:8pt}
.notice{font-size:7.6pt;padding:.5mm 2mm;gap:2mm;border-width:.5mm;border-left-width:2.5mm;
break-inside:avoid}
.notice .icon{width:4.6mm;height:4.6mm}
.notice strong{font-size:8.6pt}
.danger{border-width:1.2mm;border-left-width:2.5mm;font-size:8.6pt}
.danger strong{font-size:12pt}
h2{font-size:9pt;border-bottom-width:.35mm;margin-bottom:.4mm;break-after:avoid}
h3{font-size:7.6pt;margin-top:1mm;break-after:avoid}
small{font-size:6.4pt}
.pictures{gap:1.5mm;break-inside:avoid}
.pictures.p2{max-width:none;width:80%;margin-left:auto;margin-right:auto}
.pictures.p1{width:60%;margin-left:auto;margin-right:auto}
figcaption{font-size:6.8pt;padding:.3mm 1.2mm}
.key{margin-left:1.2mm}
figure svg.sign{width:4.4mm;height:2mm}
th,td{padding:.3mm .8mm}
thead th{font-size:6.4pt}
.bolts{font-size:7.2pt}
.bolts td,.bolts th{padding:.3mm .55mm}
.bolts tbody th{min-width:31mm}
.forbidden s,.forbidden b{text-decoration-thickness:.25mm}
.bolts .note{font-size:6.8pt;padding-left:4mm}
.bolts tbody{break-inside:avoid}
.advice td{font-size:8pt}
.advice tr{break-inside:avoid}
.advice .first th,.advice .first td{font-size:9.5pt;padding:.8mm}
.refusal{padding:1.5mm 2.5mm}
.found{padding-left:4mm}
.foot{gap:1.6mm}
.columns{gap:0 5mm}
.scores{break-inside:avoid}
.scores table{font-size:7pt}
.scores td,.scores th{padding:.15mm .6mm}
.bar{width:19mm;height:2.3mm;margin-top:.25mm}
.mid{width:21mm}
.fine,footer{font-size:6.2pt;margin-top:.3mm}
.facts{break-inside:avoid}
.facts dl>div{font-size:6.6pt;grid-template-columns:17mm 1fr}
.dense .pictures.p3{width:92%;margin-left:auto;margin-right:auto}
.dense .bolts{font-size:6.9pt;line-height:1.1}
.dense .bolts td,.dense .bolts th{line-height:1.12}
.dense .bolts th,.dense .bolts td{padding:.1mm .5mm}
.dense>*{margin-bottom:1.1mm}
.dense .pictures.p2{width:62%}
.dense .advice td,.dense .advice th,.dense .found{font-size:7pt;line-height:1.1;padding-top:.1mm;
padding-bottom:.1mm}
.dense .advice th code{display:inline;margin-left:1.5mm}
.dense .refusal{padding:.6mm 2.5mm}
.dense .notice{padding:.2mm 2mm}
.dense .scores table{font-size:6.6pt}
.dense .scores td,.dense .scores th{padding:0 .6mm}
}
""")
