import sys,os
exec(open("trial/var.py").read())
import agent.policies.stochastic as S, agent.policies.common_plan.plan as P, collections, numpy as np
V=[]
ob=P.CommonPlan._begin_visit
def bv(self,robot,station):
    v=robot.visit; ob(self,robot,station); v._n=(robot.spec.number); V.append((robot.spec.number,v))
P.Visit.__slots__
class Visit2(P.Visit):
    __slots__=("_n",)
P.Visit=Visit2
P.CommonPlan._begin_visit=bv
LOG=collections.defaultdict(list)
og=S.OnPlan._go_on
def go(self,plan,view,pursuit):
    v=self._visit; r=og(self,plan,view,pursuit)
    LOG[self._number].append((view.tick,id(v),id(self._visit),r,np.zeros(0,int) if self._missed is None else self._missed.copy(),self._index-len(self._visit.trail), (view.pose.x,view.pose.y)))
    if self._number==1:
        fog=view.fog; seen=np.where(fog.patrolled,fog.last_seen,2**30); i=int(seen.argmin()); OLD.append((view.tick,view.tick-max(int(seen.flat[i]),0),i,self._known.number_of[i]))
    return r
OLD=[]
S.OnPlan._go_on=go
sys.argv=["x"]+sys.argv[1:]
exec(open("trial/one.py").read())
# peaks
step=0.5
ticks=np.array([o[0] for o in OLD]); ages=np.array([o[1] for o in OLD])
done=set()
import random
random.seed(1)
for _ in range(10):
    k=random.choice([i for i in range(1000,len(ages)) if ages[i]>int(os.environ.get("OLDT",200))])
    t,a,pt,num=OLD[k]
    for q in range(t-300,t+300): done.add(q)
    print("PEAK tick",t,"age",a,"point",pt,"num",num, divmod(pt,V and __import__("math").inf or 1) if False else "")
    for n,v in V:
        if v.ended is not None and t-a-20<v.ended<t+60 and pt in v.points:
            i=list(v.points).index(pt)
            rows=[x for x in LOG[n] if x[1]==id(v) or x[2]==id(v)]
            print("  visit of",n,"begun",v.begun,"ended",v.ended,"before",int(v.before[i]),"n",len(v.points),"followed",(rows[0][0],rows[-1][0]) if rows else None)
            if rows:
                had=[x[0] for x in rows if x[2]==id(v) and num in x[4]]
                print("     missed it from",had[:1],"to",had[-1:], "left at least_m", [x[5] for x in rows][-1:], "rows", [(x[0],len(x[4]),round(x[5],1),tuple(round(c,1) for c in x[6])) for x in rows][::max(1,len(rows)//8)])
print("=== individually missed")
tot=collections.Counter()
for n,rows in LOG.items():
    run=[]
    for x in rows:
        if x[3] and x[5]==0.0 and len(x[4]): run.append(x)
        else:
            if len(run)>4:
                st=set(run[0][4]); 
                pts=run[0][4]
                T=run[0]
                print("robot",n,"ticks",run[0][0],run[-1][0],"n",len(pts),"->",len(run[-1][4]),"pos",run[0][6],run[-1][6])
            run=[]
