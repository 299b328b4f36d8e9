"""onoff.py GROUND COND SEED"""
import sys,os
import agent.policies.stochastic as S
N=S.Drawn.note
st={}
def note(self,view,pursuit):
    r=N(self,view,pursuit)
    p=self._on_plan
    if self._choice is self._believed: c="B"
    elif self._choice is None: c="C"
    else: c="F" if p._target is None else ("." if p._is_on else ("w" if p.waits else "x"))
    st.setdefault(self._number,[]).append((view.tick,c,len(p._plan.rows) if p._plan else 0, view.tick-p._at))
    return r
S.Drawn.note=note
sys.argv=["one.py",*sys.argv[1:]]
exec(open("trial/one.py").read())
for n,rows in sorted(st.items()):
    print(n,"".join(c for t,c,_,_ in rows[::10]))
    print(n,"".join(str(k%10) for t,c,k,_ in rows[::10]))
    print(n," ".join(str(l) for t,c,k,l in rows[::50]))
