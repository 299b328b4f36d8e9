import sys,os
exec(open("trial/var.py").read())
import agent.policies.stochastic as S, collections, numpy as np
orig=S.OnPlan.note
R=collections.defaultdict(list)
def f(self,view,pursuit):
    r=orig(self,view,pursuit)
    v=self._visit
    if v is None or self._plan is None: lat=None
    else: lat=view.tick-v.begun-self._index
    R[self._number].append((view.tick,lat,bool(r),0 if self._missed is None else int(self._missed.size), True))
    return r
S.OnPlan.note=f
KN=[]
k0=S.KnownStations.__init__
def kf(self,*a):
    k0(self,*a); KN.append(self)
S.KnownStations.__init__=kf
sys.argv=["x"]+sys.argv[1:]
exec(open("trial/one.py").read())
print("stations",[len(v) for v in KN])
for n,rows in R.items():
    a=np.array([x[1] for x in rows if x[1] is not None])
    print(n,"late ticks pct",np.percentile(a,[1,10,25,50,75,90,99]),"free",np.mean([x[2] for x in rows]),"on missed (not place)",np.mean([x[4]==False and x[3]>0 for x in rows]))
