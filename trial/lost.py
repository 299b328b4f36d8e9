import sys,os
exec(open("trial/var.py").read())
import agent.policies.stochastic as S, collections, numpy as np
orig=S.OnPlan.note
C=collections.defaultdict(collections.Counter); prev={}
E=collections.defaultdict(list)
def f(self,view,pursuit):
    r=orig(self,view,pursuit)
    v=self._visit
    key=(id(v),self._index,None if self._missed is None else len(self._missed))
    p=prev.get(self._number)
    if v is not None:
        if self._missed is None: k="free"
        elif self._index>=len(v.trail): k="chasing"
        elif p and p[0]==id(v) and p[1]==self._index: k="stuck on trail" + (" start" if self._index==0 else "")
        elif p and p[0]!=id(v): k="new visit"
        else: k="on trail"
        if self.waits(view): k="waits"
        C[self._number][k]+=1
        E[self._number].append((view.tick,k,self._index,len(v.trail),view.tick-v.begun-self._index,(round(view.pose.x,2),round(view.pose.y,2)),tuple(round(c,2) for c in v.trail[min(self._index,len(v.trail)-1)]) if v.trail else None, 0 if self._missed is None else len(self._missed), view.bumped, [ (round(q.pose.x,1),round(q.pose.y,1)) for q in view.peers.values()]))
    prev[self._number]=key
    return r
S.OnPlan.note=f
sys.argv=["x"]+sys.argv[1:]
exec(open("trial/one.py").read())
for n in sorted(C): print(n,dict(C[n]))
n=int(os.environ.get("N",2))
rows=E[n]; last=None
shown=0
for i,e in enumerate(rows):
    if e[1] in ("chasing","stuck on trail","stuck on trail start") and e[1]!=last and shown<14:
        shown+=1
        print("----")
        for q in rows[max(0,i-1):i+5]: print(q)
    last=e[1]
