(** A certificate that passes the check excludes all solutions: [check_sound]. *)
From Coq Require Import Reals ZArith List Permutation Bool Lia Lra Ring Arith.
From Lockedjoint Require Import Definitions Sums Checker.
Import ListNotations.
Open Scope R_scope.

Definition complex_matrix := nat -> nat -> C.

(** Complex symmetric 7x7 matrices with zero diagonal that satisfy the three equations *)
Record solution (W : complex_matrix) : Prop := {
  symmetric : forall i j, (i < 7)%nat -> (j < 7)%nat -> W i j = W j i;
  diagonal : forall i, (i < 7)%nat -> W i i = C0;
  row_sums : forall i, (i < 7)%nat -> Csum joints (fun k => W i k) = C0;
  square : forall i j, (i < 7)%nat -> (j < 7)%nat ->
    Csum joints (fun k => Cmul (W i k) (W k j)) = C0;
  frame : forall i j, (i < 7)%nat -> (j < 7)%nat ->
    Csum joints (fun k => Cadd (Cmul (W i k) (Cconj (W k j))) (Cmul (Cconj (W i k)) (W k j)))
    = real (4 * ((if Nat.eqb i j then 1 else 0) - 1 / 7))
}.

(** The value of a monomial and of a polynomial at a matrix *)

Definition product (l : list edge) (V : complex_matrix) : C :=
  fold_right (fun e s => Cmul (V (fst e) (snd e)) s) C1 l.
Definition value (V : complex_matrix) (m : monomial) : C := Cmul (product (w m) V) (Cconj (product (wbar m) V)).
Definition complex_of_Z (c : Z) := real (IZR c).
Definition pvalue (V : complex_matrix) (p : polynomial) : C :=
  Csum p (fun t => Cmul (complex_of_Z (fst t)) (value V (snd t))).

Lemma product_app l k V : product (l ++ k) V = Cmul (product l V) (product k V).
Proof. unfold product; induction l; simpl; [|rewrite IHl]; ring. Qed.

Lemma value_times V m n : value V (times m n) = Cmul (value V m) (value V n).
Proof. unfold value; simpl. rewrite !product_app, conj_mul. ring. Qed.

Lemma value_conjugate V m : value V (conjugate m) = Cconj (value V m).
Proof. unfold value; simpl. rewrite conj_mul, conj_conj. ring. Qed.

Lemma complex_of_Z_mul a b : complex_of_Z (a * b) = Cmul (complex_of_Z a) (complex_of_Z b).
Proof. unfold complex_of_Z. rewrite mult_IZR. apply C_eq; simpl; ring. Qed.

Lemma pvalue_scaled V c m p : pvalue V (scaled c m p) = Cmul (Cmul (complex_of_Z c) (value V m)) (pvalue V p).
Proof.
  unfold pvalue, scaled. rewrite Csum_map, <- Csum_scale. apply Csum_ext; intros t _.
  simpl fst. simpl snd. rewrite value_times, complex_of_Z_mul. ring.
Qed.

Lemma pvalue_app V p q : pvalue V (p ++ q) = Cadd (pvalue V p) (pvalue V q).
Proof. apply Csum_app. Qed.

Lemma pvalue_flat_map {A} V (f : A -> polynomial) l :
  pvalue V (flat_map f l) = Csum l (fun a => pvalue V (f a)).
Proof. induction l; simpl; [easy|]. rewrite pvalue_app, IHl. reflexivity. Qed.

Lemma Csum_conj {A} (l : list A) f : Csum l (fun a => Cconj (f a)) = Cconj (Csum l f).
Proof. induction l; simpl; [|rewrite IHl, conj_add]; apply C_eq; simpl; ring. Qed.

Lemma pvalue_squared V p : pvalue V (squared p) = Cmul (Cconj (pvalue V p)) (pvalue V p).
Proof.
  unfold squared. rewrite pvalue_flat_map.
  rewrite (Csum_ext p _ (fun t => Cmul (pvalue V p) (Cconj (Cmul (complex_of_Z (fst t)) (value V (snd t)))))).
  - rewrite Csum_scale, Csum_conj. unfold pvalue. ring.
  - intros t _. rewrite pvalue_scaled, value_conjugate, conj_mul.
    replace (Cconj (complex_of_Z (fst t))) with (complex_of_Z (fst t)) by (apply C_eq; simpl; ring). ring.
Qed.

Lemma squared_nonneg V p : 0 <= re (pvalue V (squared p)).
Proof. rewrite pvalue_squared. simpl. nra. Qed.

(** At a solution, the left side of every equation is zero. *)

Lemma left_side_zero V e : solution V -> well_formed e = true -> pvalue V (left_side e) = C0.
Proof.
  intros S H. destruct e as [i|i j|i j]; simpl in H.
  - apply Nat.ltb_lt in H. rewrite <- (row_sums _ S i H).
    unfold pvalue, left_side. rewrite Csum_map. apply Csum_ext; intros k _.
    unfold value; simpl. apply C_eq; simpl; ring.
  - apply andb_true_iff in H as [H K]. apply Nat.ltb_lt in H, K. rewrite <- (square _ S i j H K).
    unfold pvalue, left_side. rewrite Csum_map. apply Csum_ext; intros k _.
    unfold value; simpl. apply C_eq; simpl; ring.
  - apply andb_true_iff in H as [H K]. apply Nat.ltb_lt in H, K.
    unfold left_side. rewrite !pvalue_app. unfold pvalue. rewrite !Csum_map.
    pose proof (frame _ S i j H K) as F. rewrite Csum_add in F.
    rewrite (Csum_ext joints _ (fun k => Cmul (complex_of_Z 7) (Cmul (V i k) (Cconj (V k j))))).
    2:{ intros k _. unfold value; simpl. apply C_eq; simpl; ring. }
    rewrite (Csum_ext joints (fun k => Cmul _ (value V (snd (7%Z, Monomial [(k, j)] _))))
               (fun k => Cmul (complex_of_Z 7) (Cmul (Cconj (V i k)) (V k j)))).
    2:{ intros k _. unfold value; simpl. apply C_eq; simpl; ring. }
    rewrite !Csum_scale.
    match goal with |- Cadd (Cmul _ ?a) (Cadd (Cmul _ ?b) ?c) = _ =>
      transitivity (Cadd (Cmul (complex_of_Z 7) (Cadd a b)) c); [ring|] end.
    rewrite F. unfold value; simpl. destruct (Nat.eqb i j); apply C_eq; simpl; field.
Qed.

(** Relabelling the joints maps solutions to solutions. *)

Definition permutation (p : list nat) : Prop := length p = 7%nat /\ NoDup p /\ incl p joints.

Fixpoint tuples (n : nat) : list (list nat) :=
  match n with O => [[]] | S n => flat_map (fun i => map (cons i) (tuples n)) joints end.

Definition permutation_dec p : {permutation p} + {~ permutation p}.
Proof.
  unfold permutation. destruct (Nat.eq_dec (length p) 7); [|right; tauto].
  destruct (ListDec.NoDup_dec Nat.eq_dec p); [|right; tauto].
  destruct (ListDec.incl_dec Nat.eq_dec p joints); [left|right]; tauto.
Defined.

(** All 5040 permutations. The list occurs in proofs only; it is never computed. *)
Definition permutations : list (list nat) :=
  nodup (list_eq_dec Nat.eq_dec) (filter (fun p => if permutation_dec p then true else false) (tuples 7)).

Lemma in_tuples p : incl p joints -> In p (tuples (length p)).
Proof.
  induction p as [|i p]; intros H; [simpl; auto|].
  change (In (i :: p) (flat_map (fun i => map (cons i) (tuples (length p))) joints)).
  apply in_flat_map. exists i. split; [apply H; simpl; auto|]. apply in_map, IHp.
  intros x ?; apply H; simpl; auto.
Qed.

Lemma in_permutations p : In p permutations <-> permutation p.
Proof.
  unfold permutations. rewrite nodup_In, filter_In. destruct (permutation_dec p) as [r|n].
  - split; auto. intros _. split; auto. destruct r as [L [_ I]]. rewrite <- L. apply in_tuples, I.
  - split; [intros [_ F]; discriminate F | tauto].
Qed.

Lemma in_joints i : In i joints <-> (i < 7)%nat.
Proof. unfold joints. rewrite in_seq. lia. Qed.

Lemma nth_joint p i : permutation p -> (nth i p 0 < 7)%nat.
Proof.
  intros [L [_ I]]. destruct (Nat.lt_ge_cases i (length p)).
  - apply in_joints, I, nth_In, H.
  - rewrite nth_overflow by lia. lia.
Qed.

Lemma permutation_of_joints p : permutation p -> Permutation p joints.
Proof.
  intros [L [N I]]. apply NoDup_Permutation_bis; auto. rewrite L. reflexivity.
Qed.

Definition compose (p q : list nat) := map (fun i => nth i p 0%nat) q.

Lemma nth_compose p q i : (i < length q)%nat -> nth i (compose p q) 0%nat = nth (nth i q 0%nat) p 0%nat.
Proof.
  intros H. unfold compose.
  rewrite (nth_indep _ _ (nth 0 p 0%nat)) by (rewrite map_length; lia).
  apply (map_nth (fun i => nth i p 0%nat)).
Qed.

Lemma NoDup_map_on {A B} (f : A -> B) l :
  (forall x y, In x l -> In y l -> f x = f y -> x = y) -> NoDup l -> NoDup (map f l).
Proof.
  intros H N. induction N as [|x l N1 N IH]; simpl; constructor.
  - intros I. apply in_map_iff in I as [y [E I]]. apply N1.
    rewrite (H x y); simpl; auto.
  - apply IH. intros; apply H; simpl; auto.
Qed.

Lemma compose_permutation p q : permutation p -> permutation q -> permutation (compose p q).
Proof.
  intros P Q. pose proof Q as [Lq [Nq Iq]]. pose proof P as [Lp [Np _]]. repeat split.
  - unfold compose. rewrite map_length. auto.
  - apply NoDup_map_on; auto. intros x y X Y E.
    apply (proj1 (NoDup_nth p 0%nat)); auto; rewrite Lp; apply in_joints; auto.
  - intros x X. apply in_map_iff in X as [i [<- _]]. apply in_joints, nth_joint, P.
Qed.

Lemma permutations_compose q : permutation q -> Permutation (map (fun p => compose p q) permutations) permutations.
Proof.
  intros Q. apply NoDup_Permutation_bis.
  - apply NoDup_map_on; [|apply NoDup_nodup]. intros p p' P P' E.
    apply in_permutations in P, P'. destruct P as [L [_ _]], P' as [L' [_ _]].
    apply (nth_ext _ _ 0%nat 0%nat); [congruence|]. intros i I.
    assert (In i q) as J.
    { apply (Permutation_in i (Permutation_sym (permutation_of_joints q Q))), in_joints. lia. }
    apply (In_nth _ _ 0%nat) in J as [n [J <-]].
    rewrite <- !nth_compose by assumption. rewrite E. reflexivity.
  - rewrite map_length. reflexivity.
  - intros x X. apply in_map_iff in X as [p [<- P]].
    apply in_permutations, compose_permutation; auto. apply in_permutations, P.
Qed.

Definition relabelled (p : list nat) (V : complex_matrix) : complex_matrix := fun i j => V (nth i p 0%nat) (nth j p 0%nat).

Lemma Csum_relabelled p f : permutation p -> Csum joints (fun k => f (nth k p 0%nat)) = Csum joints f.
Proof.
  intros P. rewrite <- (Csum_perm _ _ f (permutation_of_joints p P)).
  rewrite <- (Csum_map (fun k => nth k p 0%nat) joints f). f_equal.
  destruct P as [L _]. apply (nth_ext _ _ 0%nat 0%nat); rewrite map_length; [simpl; auto|].
  intros n N. unfold joints in N. rewrite seq_length in N.
  rewrite (nth_indep _ _ (nth 0 p 0%nat)) by (rewrite map_length; simpl; lia).
  rewrite (map_nth (fun k => nth k p 0%nat)). unfold joints. rewrite seq_nth by lia. reflexivity.
Qed.

Lemma relabelled_solution p W : permutation p -> solution W -> solution (relabelled p W).
Proof.
  intros P S. unfold relabelled. split; intros.
  - apply (symmetric _ S); apply nth_joint, P.
  - apply (diagonal _ S), nth_joint, P.
  - rewrite <- (row_sums _ S (nth i p 0%nat) (nth_joint p i P)). apply (Csum_relabelled p (fun k => W _ k) P).
  - rewrite <- (square _ S (nth i p 0%nat) (nth j p 0%nat)) by (apply nth_joint, P).
    apply (Csum_relabelled p (fun k => Cmul (W _ k) (W k _)) P).
  - rewrite (Csum_relabelled p (fun k => Cadd (Cmul (W _ k) (Cconj (W k _))) (Cmul (Cconj (W _ k)) (W k _))) P).
    rewrite (frame _ S) by (apply nth_joint, P).
    assert (Nat.eqb (nth i p 0%nat) (nth j p 0%nat) = Nat.eqb i j) as ->; [|reflexivity].
    destruct P as [L [N _]].
    destruct (Nat.eqb_spec i j) as [->|D]; [rewrite Nat.eqb_refl; auto|].
    destruct (Nat.eqb_spec (nth i p 0%nat) (nth j p 0%nat)) as [E|]; auto.
    apply (proj1 (NoDup_nth p 0%nat) N) in E; lia.
Qed.

(** The average over all orders of the joints, times 5040. It does not change when a monomial
    is brought to its canonical form. *)

Section Average.
Variable W : complex_matrix.
Hypothesis S : solution W.

Definition mean (m : monomial) : R := sum permutations (fun p => re (value (relabelled p W) m)).
Definition pmean (p : polynomial) : R := sum p (fun t => IZR (fst t) * mean (snd t)).

Lemma pmean_value p : pmean p = sum permutations (fun q => re (pvalue (relabelled q W) p)).
Proof.
  unfold pmean, mean, pvalue.
  rewrite (sum_ext permutations _ (fun q => sum p (fun t => IZR (fst t) * re (value (relabelled q W) (snd t))))).
  - rewrite <- sum_swap. apply sum_ext; intros t _. rewrite sum_scale. reflexivity.
  - intros q _. rewrite re_Csum. apply sum_ext; intros t _. simpl. ring.
Qed.

Lemma mean_conjugate m : mean (conjugate m) = mean m.
Proof. apply sum_ext; intros. rewrite value_conjugate. reflexivity. Qed.

Lemma product_sorted l V : (forall i j, V i j = V j i) -> product (sorted_edges l) V = product l V.
Proof.
  intros Sy. induction l as [|e l IH]; [easy|]. cbn [sorted_edges fold_right].
  fold (sorted_edges l).
  assert (forall e k, product (insert e k) V = Cmul (V (fst e) (snd e)) (product k V)) as H.
  { clear. induction k as [|f k IH]; simpl; [easy|]. destruct (compare_edge e f); simpl; try easy.
    rewrite IH. ring. }
  rewrite H, IH. unfold ascending. destruct (Nat.leb (fst e) (snd e)); simpl; [easy|]. rewrite Sy. easy.
Qed.

Lemma relabelled_symmetric p : In p permutations -> forall i j, relabelled p W i j = relabelled p W j i.
Proof.
  intros P i j. apply in_permutations in P.
  apply (symmetric _ S); apply nth_joint, P.
Qed.

Lemma mean_sorted m : mean (sorted m) = mean m.
Proof.
  apply sum_ext; intros p P. unfold value; simpl.
  rewrite !product_sorted by (apply relabelled_symmetric, P). reflexivity.
Qed.

Lemma product_relabel p q l V : permutation q -> forallb edge_on_joints l = true ->
  product (map (relabel_edge q) l) (relabelled p V) = product l (relabelled (compose p q) V).
Proof.
  intros [L _] H. rewrite forallb_forall in H. unfold product.
  induction l as [|e l IH]; simpl; [easy|]. rewrite IH by (intros; apply H; simpl; auto). f_equal.
  assert (edge_on_joints e = true) as E by (apply H; simpl; auto).
  apply andb_true_iff in E as [E F]. apply Nat.ltb_lt in E, F.
  unfold relabelled. rewrite !nth_compose by lia. reflexivity.
Qed.

Lemma mean_relabel q m : permutation q -> on_joints m = true -> mean (relabel q m) = mean m.
Proof.
  intros Q H. apply andb_true_iff in H as [H K]. unfold mean.
  rewrite <- (sum_perm _ _ (fun p => re (value (relabelled p W) m)) (permutations_compose q Q)), sum_map.
  apply sum_ext; intros p _. unfold value; simpl. rewrite !product_relabel by assumption. reflexivity.
Qed.

Lemma is_permutation_spec q : is_permutation q = true -> permutation q.
Proof.
  intros H. apply andb_true_iff in H as [L H]. apply Nat.eqb_eq in L.
  rewrite forallb_forall in H.
  assert (incl joints q) as I.
  { intros i J. apply H in J. apply existsb_exists in J as [k [K E]].
    apply Nat.eqb_eq in E. subst. exact K. }
  assert (NoDup joints) as N by apply seq_NoDup.
  split; [assumption|]. split.
  - apply (NoDup_incl_NoDup N); auto. rewrite L. reflexivity.
  - apply (NoDup_length_incl N); auto. rewrite L. reflexivity.
Qed.

Lemma mean_canonical m : mean (canonical m) = mean m.
Proof.
  unfold canonical. destruct (canonical_labelling m) as [swap labels].
  destruct (is_permutation labels) eqn:R; simpl; [|easy].
  destruct (on_joints m) eqn:J; simpl; [|easy].
  apply is_permutation_spec in R. rewrite mean_sorted.
  destruct swap; rewrite mean_relabel by (auto; unfold on_joints in *; simpl; rewrite andb_comm; auto).
  - apply mean_conjugate.
  - reflexivity.
Qed.

Lemma mean_vanishes m : vanishes m = true -> mean m = 0.
Proof.
  intros H. apply sum_zero; intros p P. apply in_permutations in P.
  assert (forall l, existsb on_diagonal l = true -> product l (relabelled p W) = C0) as K.
  { clear H. induction l as [|e l IH]; simpl; [discriminate|]. unfold on_diagonal at 1.
    destruct (Nat.eqb_spec (fst e) (snd e)) as [E|_]; simpl; intros H.
    - unfold relabelled at 1. rewrite E, (diagonal _ S) by (apply nth_joint, P). ring.
    - rewrite IH by assumption. ring. }
  unfold value. apply orb_true_iff in H as [H|H]; rewrite (K _ H); simpl; ring.
Qed.

Lemma mean_normal_form m : mean (normal_form m) = mean m.
Proof.
  unfold normal_form. destruct (compare_monomial _ _); rewrite ?mean_conjugate; apply mean_sorted.
Qed.

(** Adding up like monomials does not change the average. *)

Lemma compare_edges_eq a : forall b, compare_edges a b = Eq -> a = b.
Proof.
  induction a as [|x a IH]; destruct b as [|y b]; simpl; try discriminate; auto.
  unfold compare_edge. destruct x as [i j], y as [k l]; simpl.
  destruct (Nat.compare_spec i k); try discriminate.
  destruct (Nat.compare_spec j l); try discriminate.
  intros H'. rewrite (IH _ H'). congruence.
Qed.

Lemma compare_monomial_eq m n : compare_monomial m n = Eq -> m = n.
Proof.
  destruct m, n; unfold compare_monomial; simpl.
  destruct (compare_edges w w0) eqn:E; try discriminate. intros F.
  apply compare_edges_eq in E, F. congruence.
Qed.

Lemma pmean_app p q : pmean (p ++ q) = pmean p + pmean q.
Proof. apply sum_app. Qed.

Lemma pmean_add c m t : pmean (terms (add c m t)) = IZR c * mean m + pmean (terms t).
Proof.
  induction t as [|l IHl n d r IHr]; simpl; [unfold pmean; simpl; ring|].
  destruct (compare_monomial m n) eqn:E; simpl; rewrite !pmean_app; simpl.
  - apply compare_monomial_eq in E. subst. rewrite plus_IZR. ring.
  - rewrite IHl. ring.
  - fold (pmean (terms (add c m r))). fold (pmean (terms r)). rewrite IHr. ring.
Qed.

Lemma pmean_collect p : pmean (terms (collect p)) = pmean p.
Proof.
  induction p as [|[c m] p IH]; simpl; [easy|]. rewrite pmean_add, IH. reflexivity.
Qed.

Lemma pmean_normalise p : pmean (normalise p) = pmean p.
Proof.
  induction p as [|[c m] p IH]; [easy|]. unfold pmean, normalise in *. cbn [filter snd sum fold_right map fst].
  fold (sum p (fun t => IZR (fst t) * mean (snd t))). rewrite <- IH.
  destruct (vanishes m) eqn:V; cbn [negb map sum fold_right fst snd];
    [rewrite (mean_vanishes m V)|rewrite mean_normal_form]; unfold sum; ring.
Qed.

Lemma pmean_canonical p : pmean (map (fun t => (fst t, canonical (snd t))) p) = pmean p.
Proof.
  unfold pmean. rewrite sum_map. apply sum_ext; intros t _. cbn [fst snd].
  rewrite mean_canonical. reflexivity.
Qed.

Lemma pmean_remaining c : pmean (remaining c) = pmean (expanded c).
Proof.
  unfold remaining. rewrite pmean_collect, pmean_canonical, pmean_collect. apply pmean_normalise.
Qed.

Lemma identity_permutation : In joints permutations.
Proof. apply in_permutations. repeat split; [apply seq_NoDup | apply incl_refl]. Qed.

Theorem check_sound c : check c = true -> False.
Proof.
  unfold check. rewrite !andb_true_iff. intros [[[H1 H2] H3] H4].
  apply Z.ltb_lt in H1. rewrite forallb_forall in H2, H3, H4.
  assert (pmean (remaining c) = 0) as Zero.
  { apply sum_zero. intros t T. apply H4, Z.eqb_eq in T. rewrite T. ring. }
  rewrite pmean_remaining, pmean_value in Zero.
  assert (forall p, In p permutations -> IZR (constant c) <= re (pvalue (relabelled p W) (expanded c))) as Pos.
  { intros p P. apply in_permutations in P. pose proof (relabelled_solution p W P S) as Sp.
    set (V := relabelled p W) in *. unfold expanded. cbn [pvalue Csum fold_right].
    match goal with |- context [fold_right _ _ (?a ++ ?b)] =>
      change (IZR (constant c) <= re (Cadd (Cmul (complex_of_Z (constant c)) (value V one)) (pvalue V (a ++ b)))) end.
    rewrite pvalue_app, !pvalue_flat_map.
    rewrite (Csum_ext (multipliers c) _ (fun _ => C0)).
    2:{ intros [[a m] e] I. rewrite pvalue_scaled, (left_side_zero V e Sp).
        - ring.
        - apply (H3 _ I). }
    assert (0 <= re (Csum (squares c) (fun s => pvalue V (scaled (fst s) one (squared (snd s)))))) as Q.
    { rewrite re_Csum. apply sum_nonneg. intros s I. rewrite pvalue_scaled.
      apply H2, Z.leb_le, IZR_le in I.
      pose proof (squared_nonneg V (snd s)) as N.
      unfold value; simpl. set (x := re _) in N |- *. nra. }
    assert (Csum (multipliers c) (fun _ => C0) = C0) as ->.
    { clear. induction (multipliers c); simpl; [easy|]. rewrite IHl. ring. }
    simpl. lra. }
  assert (0 < IZR (constant c)) as H1' by (apply (IZR_lt 0); exact H1).
  assert (forall l, incl l permutations ->
    INR (length l) * IZR (constant c) <= sum l (fun p => re (pvalue (relabelled p W) (expanded c)))) as B.
  { induction l as [|p l IH]; intros I; [simpl; lra|].
    cbn [sum fold_right length]. fold (sum l (fun p => re (pvalue (relabelled p W) (expanded c)))).
    rewrite S_INR. assert (In p permutations) as P by (apply I; simpl; auto). apply Pos in P.
    assert (incl l permutations) as I' by (intros x X; apply I; simpl; auto). apply IH in I'. lra. }
  specialize (B permutations (incl_refl _)). rewrite Zero in B.
  pose proof identity_permutation as Id. destruct permutations as [|p l]; [easy|].
  cbn [length] in B. rewrite S_INR in B. pose proof (pos_INR (length l)). nra.
Qed.
End Average.
