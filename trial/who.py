"""who.py SCENARIO DURATION: which plan each robot follows, each 20 s"""
import sys,os,yaml
import agent.policies.stochastic as S
N=S.Drawn.note
st={}
def note(self,view,pursuit):
    r=N(self,view,pursuit)
    p=self._on_plan; b=self._believed
    if self._choice is b: c="".join(map(str,b._fleet.drawing.numbers if b._fleet.drawing else []))+"B"+("f" if r else "")
    elif self._choice is None: c="C"
    else: c="".join(map(str,p._plan.rows))+("F" if p._target is None else ("." if p._is_on else ("w" if p.waits else "x")))
    step=self._living._step
    if view.tick%int(float(sys.argv[3])/step)==0: st.setdefault(self._number,{})[view.tick*step]=c
    return r
S.Drawn.note=note
from fogwatch.inprocess import run_in_process
from patrol.scenario import load_scenario
m=yaml.safe_load(open(sys.argv[1])); os.chdir(os.path.dirname(os.path.abspath(sys.argv[1]))); m["duration"]=int(sys.argv[2])
o=run_in_process(load_scenario(m),keep=False,verify_fog=False)
for n,rows in sorted(st.items()): print(n," ".join(f"{int(t)}:{c}" for t,c in rows.items()))
