"""bm.py OUT TERRAINS CONDS SEEDS"""
import sys,os,csv
exec(open("trial/var.py").read())
import agent.policies.stochastic as S
for k,v in os.environ.items():
    if k.startswith("S_"): setattr(S,k[2:],type(getattr(S,k[2:]))(float(v)))
out,ter,conds,seeds=sys.argv[1:5]
extra=sys.argv[5:]
import io,contextlib
sys.argv=["fogwatch","benchmark","--preset","conditions","--policies",os.environ.get("POL","stochastic"),"--terrains",ter,"--conditions",conds,"--seeds",seeds,"--workers","1","--out",out,*extra]
from fogwatch.__main__ import *
import fogwatch.__main__ as M
try:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        M.main()
except SystemExit: pass
env=" ".join(f"{k}={v}" for k,v in sorted(os.environ.items()) if k[:2] in("P_","S_","L_","R_"))
for r in csv.DictReader(open(out+"/cells.csv")):
    print(r["terrain"],r["condition"],env,"mfow",r.get("mfow_mean_s",r.get("mfow_late_mean_s","?"))[:5],"watch",r["intruder_moving_watching_percent"][:4],"gain",r["intruder_moving_gain_points"][:4],flush=True)
