"""How the panel beside the picture looks."""

from __future__ import annotations

from boltpose.report.markup import Html

STYLE = Html("""<style>
.bp{font:13px/1.35 system-ui,"Segoe UI","Liberation Sans","DejaVu Sans",Arial,sans-serif;
padding:2px 12px 8px;color:#111;overflow-wrap:anywhere}
.bp h3{font-size:13px;margin:12px 0 4px;padding-bottom:2px;border-bottom:1.5px solid #111}
.bp p{margin:4px 0}
.bp small{color:#555;font-weight:normal;font-size:11.5px}
.bp table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
.bp th,.bp td{text-align:left;vertical-align:top;padding:2px 4px;font-weight:normal}
.bp thead th{font-size:11.5px;color:#555;border-bottom:1px solid #999}
.bp tbody tr{border-bottom:1px solid #e4e4e4}
.bp .n{text-align:right;white-space:nowrap}
.bp .icon{width:1.1em;height:1.1em;vertical-align:-.18em}
.bp .verdict{border-radius:8px;padding:10px 14px;color:#fff;margin:4px 0 6px}
.bp .verdict b{display:block;font-size:34px;line-height:1.05;letter-spacing:.03em}
.bp .verdict.ok{background:#14692f}.bp .verdict.refused{background:#a80019}
.bp .verdict.busy{background:#22508c}.bp .verdict.wait{background:#5b6470}
.bp .verdict span{display:block;font-size:14px}
.bp .verdict ul{margin:5px 0 0;padding-left:18px}
.bp .verdict .of{opacity:.85;font-size:12.5px;margin-top:4px}
.bp .reason{border-left:6px solid #a80019;background:#fdeaea;padding:5px 9px;margin:6px 0}
.bp .reason b{font-size:15px;display:block}
.bp .notice{display:flex;gap:8px;align-items:center;border:2px solid #111;border-left-width:9px;
background:#fff3b8;padding:5px 9px;margin:6px 0}
.bp .notice .icon{width:24px;height:24px;flex:none}
.bp .error{border:2px solid #a80019;border-left-width:9px;background:#fdeaea;padding:6px 10px;
margin:6px 0}
.bp .bar{position:relative;height:8px;border-radius:4px;min-width:64px;margin-top:5px;
background:linear-gradient(90deg,#e3e3e3 50%,#a9cfb2 50%)}
.bp .bar i{position:absolute;top:-2px;width:12px;height:12px;margin-left:-6px;border-radius:50%;
background:#14692f}
.bp .bar i.missed{background:#a80019;border-radius:0;transform:rotate(45deg)}
.bp .bar u{position:absolute;left:50%;top:-3px;width:2px;height:14px;margin-left:-1px;
background:#111}
.bp tr.missed{background:#fdeaea}
.bp tr.forbidden{background:#fdeaea;color:#a80019}
.bp tr.forbidden s{text-decoration-thickness:2px}
.bp .stages{display:flex;height:14px;border-radius:4px;overflow:hidden;margin:4px 0}
.bp .stages i{display:block;height:100%}
.bp .chip{display:inline-block;width:12px;height:12px;border-radius:3px;margin:0 6px -2px 0;
border:1px solid #0003}
.bp code{font-size:11.5px}
.bpsign{position:fixed;bottom:14px;left:14px;z-index:50;pointer-events:none;color:#fff;
border-radius:10px;padding:12px 22px;box-shadow:0 3px 14px #0004;max-width:46vw;
font:16px/1.3 system-ui,"Segoe UI","Liberation Sans","DejaVu Sans",Arial,sans-serif}
.bpsign b{display:block;font-size:44px;line-height:1.05;letter-spacing:.03em}
.bpsign.ok{background:#14692fe8}.bpsign.refused{background:#a80019f0}
.bpsign.busy{background:#22508cf0}.bpsign.wait{background:#5b6470e8}
.bpsign .of{display:block}
.bpsign ul{margin:6px 0 0;padding-left:20px}
.bpsign .of{opacity:.85;font-size:13px;margin-top:4px}
.bptip{position:fixed;transform:translate(-50%,-100%);z-index:40;cursor:help}
.bptip .tip{display:none;position:absolute;width:370px;background:#fff;border-radius:8px;
box-shadow:0 3px 14px #0006;pointer-events:none}
.bptip.up .tip{bottom:0}.bptip.down .tip{top:0}
.bptip.right .tip{left:calc(100% + 14px)}.bptip.left .tip{right:calc(100% + 14px)}
.bptip:hover .tip{display:block}.bptip:hover{z-index:45}
div:has(>input[type=file]){position:relative;height:84px;border:2px dashed #22508c;
border-radius:10px;background:#eef4fb;display:flex;align-items:center;justify-content:center}
div:has(>input[type=file]):hover{background:#d7e6f7}
div>input[type=file]{display:block!important;position:absolute;inset:0;width:100%;height:100%;
opacity:0;cursor:pointer;z-index:2}
div>input[type=file]+button{width:auto;padding:0 18px}
</style>""")
"""Put once into the page, in front of anything of class `bp`.

The last lines lay the browser's own, invisible field for files over the upload button: whatever is
dropped on it is uploaded, without a script of ours in the page.
"""
